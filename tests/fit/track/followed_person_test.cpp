// Whose points the next frame's are, step by step: kept, forgotten, halved, tried and given up.
#include "fit/track/followed_person.hpp"

#include <gtest/gtest.h>

namespace booth::fit {
namespace {

FitResult at(double x, FitState state = FitState::tracked, double left = 0.03) {
  FitResult r;
  r.state = state;
  r.joints.setZero();
  r.joints.row(0).setConstant(x);
  r.joints.row(1).setLinSpaced(0.1, 1.7);
  r.energy.cloud_to_model = left;
  r.coverage = 0.9;
  return r;
}

/// Columns of points, 1.7 m high and 0.2 m thick, at these x.
Observation columns(std::initializer_list<float> places, double time, bool crowded = false) {
  Observation o(20000);
  for (const float x : places)
    for (int i = 0; i < 2000; ++i) {
      const float a = 0.1f * static_cast<float>(i);
      o.cloud.push({x + 0.1f * std::cos(a), 1.7f * static_cast<float>(i) / 2000, 0.1f * std::sin(a)}, Eigen::Vector3f::Zero(), 0);
    }
  o.time = time;
  o.crowded = crowded;
  return o;
}

TEST(FollowedPerson, BonesMoveOnAndAreForgottenAfterAWhile) {
  FollowedPerson f({});
  EXPECT_TRUE(f.at(0).bones.empty());
  EXPECT_TRUE(f.remember(at(0, FitState::estimated), columns({0}, 0)));
  EXPECT_TRUE(f.remember(at(0.05), columns({0.05f}, 0.05)));
  const Followed next = f.at(0.10);
  ASSERT_EQ(next.bones.size(), static_cast<std::size_t>(kBones));
  EXPECT_TRUE(next.now);
  EXPECT_NEAR(next.bones[0].from.x(), 0.10f, 1e-4f) << "at the speed it had";
  EXPECT_FALSE(f.at(0.5).now) << "half a second later they may be elsewhere";
  EXPECT_FALSE(f.at(0.5).bones.empty());
  EXPECT_GT(f.at(0.5).strayed, f.at(0.1).strayed);
  EXPECT_TRUE(f.at(1.2).bones.empty());
  EXPECT_TRUE(f.at(-1).bones.empty()) << "a clock that went back";
  f.forget();
  EXPECT_TRUE(f.at(0.10).bones.empty());
}

TEST(FollowedPerson, AFrameWithoutImagesLeavesTheBonesAsGoodAsTheyWere) {
  FollowedPerson f({});
  f.remember(at(0), columns({0}, 0));
  EXPECT_TRUE(f.remember(at(0, FitState::lost), Observation(10)));
  EXPECT_TRUE(f.at(0.06).now);
  f.remember(at(0, FitState::lost), columns({0}, 0.03));  // seen, and not explained
  EXPECT_FALSE(f.at(0.06).now);
}

TEST(FollowedPerson, EitherHalfOfWhatNoBodyExplainsIsTriedTheNearerFirst) {
  FollowedPerson f({});
  EXPECT_FALSE(f.remember(at(0.4, FitState::estimated, 0.45), columns({0.1f, 0.7f}, 0))) << "the body of two people is not told";
  EXPECT_TRUE(f.start_over());
  const Followed first = f.at(0.03);
  ASSERT_EQ(first.bones.size(), 1u);
  EXPECT_TRUE(first.now);
  EXPECT_NEAR(first.bones[0].from.x(), 0.1f, 0.02f);
  EXPECT_FALSE(f.remember(at(0, FitState::lost), [] {
    Observation none(10);
    none.time = 0.03;
    return none;
  }()));
  EXPECT_NEAR(f.at(0.06).bones[0].from.x(), 0.1f, 0.02f) << "a frame without images says nothing of it";
  EXPECT_FALSE(f.remember(at(0.1, FitState::estimated, 0.40), columns({0.1f}, 0.06, true)));
  EXPECT_NEAR(f.at(0.09).bones[0].from.x(), 0.7f, 0.02f);
  EXPECT_TRUE(f.remember(at(0.7, FitState::estimated, 0.15), columns({0.7f}, 0.09, true))) << "that is a person";
  EXPECT_FALSE(f.start_over());
  EXPECT_TRUE(f.at(0.12).crowded);
  EXPECT_EQ(f.at(0.12).bones.size(), static_cast<std::size_t>(kBones));
}

TEST(FollowedPerson, WhereNeitherHalfIsAPersonTheWholeIsTakenAndTriedAgainEverMoreSeldom) {
  FollowedPerson f({});
  double time = 0;
  std::vector<double> trials;
  for (int frame = 0; frame < 600; ++frame, time += 1.0 / 30) {
    const bool half = f.at(time).bones.size() == 1;
    if (half && f.start_over() && (trials.empty() || time - trials.back() > 0.1)) trials.push_back(time);
    f.remember(at(0.4, frame == 0 ? FitState::estimated : FitState::tracked, 0.4), columns({0.1f, 0.7f}, time, half));
  }
  ASSERT_GE(trials.size(), 4u);
  EXPECT_LE(trials.size(), 6u);
  for (std::size_t k = 2; k < trials.size(); ++k) EXPECT_GT(trials[k] - trials[k - 1], 1.5 * (trials[k - 1] - trials[k - 2])) << k;
}

TEST(FollowedPerson, WhoWasFollowedComesBeforeWhoIsNearerTheCentre) {
  FollowedPerson f({});
  f.remember(at(0.7), columns({0.7f}, 0));
  int frame = 1;
  while (!f.start_over() && frame < 30) f.remember(at(0, FitState::lost), columns({0.1f, 0.7f}, frame / 30.0)), ++frame;
  ASSERT_TRUE(f.start_over());
  EXPECT_GT(frame, 10) << "a moment of doubt is none";
  const Followed half = f.at(frame / 30.0);
  ASSERT_EQ(half.bones.size(), 1u);
  EXPECT_NEAR(half.bones[0].from.x(), 0.7f, 0.02f);
}

TEST(FollowedPerson, OnePersonIsNotHalved) {
  FollowedPerson f({});
  for (int frame = 0; frame < 60; ++frame) EXPECT_TRUE(f.remember(at(0, FitState::tracked, 0.45), columns({-0.15f, 0.15f}, frame / 30.0)));
}

}  // namespace
}  // namespace booth::fit
