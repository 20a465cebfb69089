// Simulated people in the simulated booth, noise and all: who is found, how well, and what happens when the scene is not as it should be.
#include <gtest/gtest.h>

#include <set>

#include "daemon/io/model_file.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "fit/estimator.hpp"
#include "fit/track/followed_person.hpp"

namespace booth {
namespace {

using fit::FitState;

/// Models are loaded once for all tests.
struct Models {
  std::filesystem::path folder = daemon::find_models(std::filesystem::path(BOOTH_SOURCE_DIR) / "fit/models");
  std::shared_ptr<const fit::BodyModel> men = std::make_shared<fit::BodyModel>(daemon::load_body_model(folder / "men.npz"));
  std::shared_ptr<const fit::BodyModel> women = std::make_shared<fit::BodyModel>(daemon::load_body_model(folder / "women.npz"));
  std::shared_ptr<const fit::PosePrior> prior = std::make_shared<fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz"));
};
const Models& models() {
  static const Models m;
  return m;
}

drivers::Person person(int test_body, const std::string& motion, Eigen::Vector2d stand_at = {0, 0}) {
  const daemon::TestBody body = daemon::load_test_body(models().folder / "test_bodies.npz", test_body);
  const auto& model = body.sex == fit::Sex::men ? models().men : models().women;
  drivers::Person p = drivers::make_person("test:" + std::to_string(test_body), model, body.rest, body.rest_joints,
                                           drivers::motion_by_name(motion, 0, drivers::contact_of(*model, body.rest, body.rest_joints)));
  p.stand_at = stand_at;
  return p;
}

/// Somebody whose motion takes them along a line in the meantime.
drivers::Person person_on_a_way(int test_body, const std::string& motion, double seconds, const std::function<Eigen::Vector2d(double time)>& at) {
  drivers::Person p = person(test_body, motion);
  drivers::Motion way;
  for (int k = 0; k <= std::lround(seconds * way.rate); ++k) {
    const double t = k / way.rate;
    way.frames.push_back(p.motion.at(t));
    way.frames.back()[2] += at(t).x(), way.frames.back()[0] += at(t).y();  // booth to CMU
  }
  p.motion = way;
  return p;
}

struct Outcome {
  fit::FitResult last;
  fit::CloudReport report;
  std::vector<double> joint_error;  ///< of each frame's 15 main joints, mean, m
  int lost = 0, crowded = 0;
  int bodies = 0;   ///< times that a body was accepted
  int changes = 0;  ///< from lost to not lost or back, after the first frame
};

/// Runs `frames` groups of the scene. Cameras in `blind` deliver nothing, and of the groups in `missed` nothing arrives.
Outcome run(drivers::SceneSettings settings, std::vector<drivers::Person> persons, int frames, const std::vector<int>& blind = {},
            const std::set<int>& missed = {}) {
  settings.pace = drivers::Pace::fast;
  settings.phase_spread = 0.01;
  settings.seconds = frames / 30.0 + 0.5;
  drivers::Source source = drivers::make_scene(settings, std::move(persons), std::make_shared<drivers::SystemClock>());
  std::vector<fit::Camera> cameras;
  for (const auto& c : source.cameras) cameras.push_back(daemon::fit_camera(c->description()));
  fit::CloudBuilder builder({}, cameras);
  for (const auto& b : source.background) builder.set_background(hal::to_int(b.camera), b.depth);
  fit::Observation observation = builder.make_observation(60000);
  fit::FollowedPerson followed({});
  fit::Estimator estimator(models().men, models().women, models().prior, {});
  const auto is_blind = [&](std::size_t c) { return std::find(blind.begin(), blind.end(), static_cast<int>(c)) != blind.end(); };
  for (std::size_t c = 0; c < cameras.size(); ++c)
    if (!is_blind(c)) source.cameras[c]->start();

  Outcome out;
  std::vector<hal::DepthFrame> frame(cameras.size());
  bool was_lost = true, had_body = false;
  for (int f = 0; f < frames; ++f) {
    double reference = 0;
    int seeing = 0;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      if (is_blind(c)) continue;
      EXPECT_EQ(source.cameras[c]->read(frame[c], std::chrono::seconds(5)), hal::ReadStatus::frame);
      reference += hal::seconds(frame[c].captured.time_since_epoch());
      ++seeing;
    }
    reference /= seeing;
    std::vector<fit::DepthInput> inputs;
    for (std::size_t c = 0; c < cameras.size(); ++c)
      if (!is_blind(c) && !missed.contains(f))
        inputs.push_back({static_cast<int>(c), frame[c].depth.data(), hal::seconds(frame[c].captured.time_since_epoch()) - reference});
    observation.frame = static_cast<std::uint64_t>(f);
    observation.time = reference;
    builder.build(inputs, observation, out.report, followed.at(reference));
    if (followed.start_over()) estimator.start_over();
    out.last = estimator.step(observation);
    if (!followed.remember(out.last, observation)) out.last.state = FitState::lost;
    const bool lost = out.last.state == FitState::lost;
    out.changes += f > 0 && lost != was_lost;
    was_lost = lost;
    out.lost += lost;
    out.crowded += out.report.crowded;
    if (!lost) out.bodies += out.last.body_accepted && !had_body, had_body = out.last.body_accepted;
    if (const auto truth = source.truth ? source.truth->at(hal::MonotonicTime(hal::from_seconds(reference))) : std::nullopt) {
      double error = 0;
      for (int j : fit::main_joints())
        error +=
            (fit::booth_from_cmu(out.last.joints.col(j)) - Eigen::Map<const Eigen::Vector3d>(truth->joints[static_cast<std::size_t>(j)].data())).norm() / 15;
      out.joint_error.push_back(error);
    }
  }
  for (auto& c : source.cameras) c->stop();
  return out;
}

double worst(const std::vector<double>& v) { return *std::max_element(v.begin(), v.end()); }

Eigen::Vector3d joint(const Outcome& o, const char* name) { return fit::booth_from_cmu(o.last.joints.col(fit::joint_index(name))); }

TEST(Scenes, OnlyTheLeftArmIsRaised) {
  const Outcome o = run({}, {person(2, "left-arm")}, 75);  // by then it is up
  ASSERT_EQ(o.lost, 0);
  EXPECT_GT(joint(o, "lwrist").z(), joint(o, "head_base").z());
  EXPECT_LT(joint(o, "rwrist").z(), joint(o, "rshoulder").z() - 0.3);
  EXPECT_GT(joint(o, "lshoulder").y(), joint(o, "rshoulder").y()) << "facing +x, the left side is +y";
  EXPECT_LT(worst(o.joint_error), 0.04);
}

TEST(Scenes, AManAndAWomanWhomTheModelHasNeverSeenAreFollowed) {
  for (const auto& [body, motion, sex] : {std::tuple{11, "walk", fit::Sex::men}, {71, "squat", fit::Sex::women}}) {
    const Outcome o = run({}, {person(body, motion)}, 45);
    EXPECT_EQ(o.lost, 0) << motion;
    EXPECT_EQ(o.last.state, FitState::tracked) << motion;
    EXPECT_EQ(o.last.sex, sex) << motion;
    EXPECT_TRUE(o.last.body_accepted) << motion;
    double mean = 0;
    for (double e : o.joint_error) mean += e / static_cast<double>(o.joint_error.size());
    EXPECT_LT(mean, 0.02) << motion;
    EXPECT_LT(o.last.cloud_to_model.mean, 0.008) << motion;
  }
}

TEST(Scenes, AnEmptyRoomIsNobody) {
  const Outcome o = run({}, {}, 3);
  EXPECT_EQ(o.lost, 3);
  EXPECT_EQ(o.report.outcome, fit::CloudOutcome::empty_stage);
}

TEST(Scenes, AChairIsNobodyAndDoesNotDisturb) {
  drivers::SceneSettings with_chair;
  with_chair.obstacles = drivers::chair(-0.9, 0.6);
  const Outcome alone = run(with_chair, {}, 2);
  EXPECT_EQ(alone.lost, 2);
  const Outcome beside = run(with_chair, {person(5, "wave")}, 10);
  EXPECT_EQ(beside.lost, 0);
  EXPECT_LT(worst(beside.joint_error), 0.04);
}

TEST(Scenes, OfTwoPeopleTheOneNearestTheCentreIsFollowed) {
  // The truth is the first person's, who stands nearer the centre.
  const Outcome o = run({}, {person(8, "wave", {0.1, 0}), person(50, "a-pose", {-0.3, 1.3})}, 10);
  EXPECT_EQ(o.lost, 0);
  EXPECT_EQ(o.report.persons, 2);
  EXPECT_LT(worst(o.joint_error), 0.05);
}

TEST(Scenes, TwoPeopleWhoChangePlacesAreNotTakenForEachOther) {
  const auto leaves = [](double t) { return Eigen::Vector2d(0, -std::min(1.2, 0.8 * t)); };
  const auto comes = [](double t) { return Eigen::Vector2d(0, std::max(0.05, 1.3 - 0.8 * t)); };
  const Outcome o = run({}, {person_on_a_way(8, "wave", 3, leaves), person_on_a_way(50, "a-pose", 3, comes)}, 75);
  EXPECT_EQ(o.lost, 0);
  EXPECT_LT(worst(o.joint_error), 0.03);
}

TEST(Scenes, WhoIsFollowedStaysThemselvesWhereSomebodyTouchesThem) {
  // From 1.85 m they come to 0.45 m and go again.
  const auto comes = [](double t) { return Eigen::Vector2d(0, 0.45 + std::abs(t - 2.0) * 0.7); };
  const Outcome o = run({}, {person(8, "wave"), person_on_a_way(50, "a-pose", 4, comes)}, 115);
  EXPECT_EQ(o.lost, 0);
  EXPECT_GT(o.crowded, 10);
  EXPECT_LT(worst(o.joint_error), 0.04);
  EXPECT_FALSE(o.last.energy.cloud_to_model > 0.05) << "nor has the body changed";
}

TEST(Scenes, OfTwoPeopleWhoTouchFromTheBeginningOneIsFound) {
  const auto goes = [](double t) { return Eigen::Vector2d(0, 0.45 + std::max(t - 1.5, 0.0) * 0.8); };
  for (const std::set<int>& missed : {std::set<int>{}, {1}}) {
    const Outcome o = run({}, {person(8, "wave"), person_on_a_way(50, "a-pose", 4, goes)}, 90, {}, missed);
    const std::size_t known = 2 + missed.size();
    EXPECT_LE(o.lost, static_cast<int>(known)) << "while it is not known who";
    for (std::size_t f = known; f < o.joint_error.size(); ++f) EXPECT_LT(o.joint_error[f], f < 60 ? 0.15 : 0.06) << f;
    EXPECT_LT(o.joint_error.back(), 0.02);
    EXPECT_TRUE(o.last.body_accepted);
  }
}

TEST(Scenes, WhoIsKnownKeepsTheirBodyWhereImagesWereMissingWhileSomebodyTouchedThem) {
  const auto comes = [](double t) { return Eigen::Vector2d(0, t < 1.1 ? 1.6 : 0.45 + std::max(0.0, t - 2.0) * 0.8); };
  const Outcome o = run({}, {person(8, "wave"), person_on_a_way(50, "a-pose", 4, comes)}, 100, {}, {30, 31, 32, 33, 34, 35, 36, 37, 38, 39});
  for (std::size_t f = 60; f < o.joint_error.size(); ++f) EXPECT_LT(o.joint_error[f], f < 85 ? 0.15 : 0.03) << f;
  EXPECT_EQ(o.bodies, 1) << "the body that was accepted is still accepted";
}

/// An A-pose, as if a photograph of it had been made smaller.
drivers::Person scaled_person(double scale) {
  drivers::Person p = person(50, "a-pose");
  p.rest *= static_cast<float>(scale), p.rest_joints *= scale;
  for (auto& q : p.motion.frames) q[1] *= scale;
  return p;
}

TEST(Scenes, AFigureOfAToddlersSizeIsNobody) {
  const Outcome o = run({}, {scaled_person(0.65)}, 45);  // 1.05 m
  EXPECT_EQ(o.lost, 45);
}

TEST(Scenes, WhoIsSmallIsFollowedOnceTheyWereFound) {
  // At 1.13 and 1.21 m they are of a person's size in some frames only.
  for (const double scale : {0.7, 0.75}) {
    const Outcome o = run({}, {scaled_person(scale)}, 60);
    ASSERT_LT(o.lost, 45) << scale;
    EXPECT_EQ(o.changes, 1) << scale;
    EXPECT_LT(o.joint_error.back(), 0.03) << scale;
  }
}

TEST(Scenes, OneCameraOfFourIsEnoughToFindSomebody) {
  const Outcome o = run({}, {person(3, "a-pose")}, 5, {1, 2, 3});
  EXPECT_EQ(o.lost, 0);
  EXPECT_LT(o.joint_error.back(), 0.10);
  EXPECT_LT(o.last.coverage, 0.75) << "half of the body was never seen";
  const Outcome all = run({}, {person(3, "a-pose")}, 5);
  double one_sd = 0, all_sd = 0;
  for (int j = 0; j < fit::kJoints; ++j) {
    one_sd += std::sqrt(o.last.joint_covariance[static_cast<std::size_t>(j)].trace());
    all_sd += std::sqrt(all.last.joint_covariance[static_cast<std::size_t>(j)].trace());
  }
  EXPECT_GT(one_sd, all_sd) << "less was seen, so less is known";
}

TEST(Scenes, SomebodyHalfOutOfTheCylinderIsReportedAndHarmless) {
  const Outcome o = run({}, {person(6, "a-pose", {0, 1.95})}, 5);
  EXPECT_TRUE(o.report.touches_border || o.report.outcome != fit::CloudOutcome::person);
  EXPECT_TRUE(o.last.q.allFinite());
}

}  // namespace
}  // namespace booth
