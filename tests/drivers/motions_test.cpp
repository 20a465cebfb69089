// The project's own motions must be something a person can do, and motions from files must come to stand on the stage.
#include "drivers/synthetic/motions.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "drivers/synthetic/scene.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::tests {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

drivers::Contact capsule_contact() {
  const auto body = capsule_body();
  fit::Vertices rest;
  body->shaped(fit::ShapeVector(), rest);
  return drivers::contact_of(*body, rest, body->rest_joints(fit::ShapeVector()));
}

class OwnMotion : public testing::TestWithParam<std::string_view> {};

TEST_P(OwnMotion, KeepsTheLowestFootOnTheFloorUnlessItJumps) {
  const auto contact = capsule_contact();
  const auto motion = drivers::motion_by_name(GetParam(), 0, contact);
  double highest = 0;
  for (const auto& q : motion.frames) {
    const double low = drivers::lowest_foot(q, contact);
    EXPECT_GT(low, -1e-9);
    highest = std::max(highest, low);
  }
  if (GetParam() == "jump" || GetParam() == "showcase")
    EXPECT_NEAR(highest, 0.13, 0.02);  // 1.6 m/s at take-off
  else
    EXPECT_LT(highest, 1e-9);
}

TEST_P(OwnMotion, MovesNoJointFasterThanPeopleDo) {
  const auto motion = drivers::motion_by_name(GetParam(), 0, capsule_contact());
  for (std::size_t i = 0; i < motion.frames.size(); ++i) {
    const fit::PoseVector step = motion.frames[(i + 1) % motion.frames.size()] - motion.frames[i];
    for (int k = 0; k < fit::kDofs; ++k) {
      if (k < 3) {
        EXPECT_LT(std::abs(step[k]), 0.07) << fit::dof_name(k) << " at frame " << i;  // metres
      } else {
        EXPECT_LT(std::abs(step[k]), 18 * kDegree) << fit::dof_name(k) << " at frame " << i;
      }
    }
  }
}

TEST_P(OwnMotion, StaysOnTheStageAndBendsKneesAndElbowsTheRightWay) {
  const auto motion = drivers::motion_by_name(GetParam(), 0, capsule_contact());
  for (const auto& q : motion.frames) {
    EXPECT_LT(std::hypot(q[0], q[2]), 1.3);
    for (const int k : {14, 20, 27, 33}) EXPECT_GE(q[k], 0) << fit::dof_name(k);
  }
}

TEST_P(OwnMotion, HasTheLengthThatWasAskedFor) {
  const auto motion = drivers::motion_by_name(GetParam(), 3.0, capsule_contact());
  EXPECT_EQ(motion.frames.size(), 91u);
  EXPECT_FALSE(motion.cyclic);
}

INSTANTIATE_TEST_SUITE_P(Motions, OwnMotion, testing::ValuesIn(drivers::motion_names()), [](const auto& name) {
  std::string text(name.param);
  std::erase(text, '-');
  return text;
});

TEST(Motions, ShowcaseLastsMoreThanTwentySecondsAndUsesEveryLimb) {
  const auto motion = drivers::motion_by_name("showcase", 0, capsule_contact());
  EXPECT_GT(motion.seconds(), 20);
  fit::PoseVector low = motion.frames[0], high = motion.frames[0];
  for (const auto& q : motion.frames) {
    low = low.cwiseMin(q);
    high = high.cwiseMax(q);
  }
  for (const char* name : {"lhumerus_rx", "rhumerus_rx", "lradius_rx", "rradius_rx", "lfemur_rx", "rfemur_rx", "ltibia_rx", "rtibia_rx"}) {
    const int k = fit::dof_index(name);
    EXPECT_GT(high[k] - low[k], 40 * kDegree) << name;
  }
  EXPECT_GT(high[4] - low[4], 180 * kDegree);
}

TEST(Motions, UnknownNamesAreAnsweredWithTheKnownOnes) {
  try {
    drivers::motion_by_name("moonwalk", 0, {});
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("roll-hands"), std::string::npos);
  }
}

TEST(Motion, PassesThroughItsFramesAndIsPlayedToAndFro) {
  drivers::Motion m;
  for (int i = 0; i < 4; ++i) {
    m.frames.push_back(fit::PoseVector::Zero());
    m.frames.back()[7] = i * i;
  }
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(m.at(i / 30.0)[7], i * i, 1e-9);
  EXPECT_NEAR(m.at(4 / 30.0)[7], 4, 1e-9);
  EXPECT_NEAR(m.at(6 / 30.0)[7], 0, 1e-9);
  EXPECT_NEAR(m.at(1.5 / 30)[7], 2.25, 1e-9) << "a cubic follows a parabola inside";
  m.cyclic = true;
  EXPECT_NEAR(m.at(4 / 30.0)[7], 0, 1e-9);
}

TEST(Motion, APathBeyondTheStageIsFoldedBack) {
  drivers::Motion m;
  for (int i = 0; i <= 100; ++i) {
    m.frames.push_back(fit::PoseVector::Zero());
    m.frames.back()[2] = 0.06 * i;  // six metres straight ahead
    m.frames.back()[1] = 2;
  }
  const auto contact = capsule_contact();
  auto kept = m;
  drivers::place_on_stage(kept, contact, {.keep_path = true});
  EXPECT_EQ(kept.frames[100][2], m.frames[100][2]);
  drivers::place_on_stage(m, contact, {.leg_scale = 1.1});
  double before = 0, low = 1;
  for (std::size_t i = 0; i < m.frames.size(); ++i) {
    const auto& q = m.frames[i];
    EXPECT_LE(std::hypot(q[0], q[2]), 1 + 1e-9);
    if (i > 0) {
      EXPECT_LT(std::abs(q[2] - before), 0.067) << "no jump where the path turns";
    }
    before = q[2];
    low = std::min(low, drivers::lowest_foot(q, contact));
  }
  EXPECT_NEAR(low, 0, 1e-9);
}

}  // namespace
}  // namespace booth::tests
