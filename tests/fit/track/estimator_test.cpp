// The estimator as the daemon uses it: found, followed, lost and found again; the same bits for any number of threads; nothing allocated.
#include "fit/estimator.hpp"

#include <gtest/gtest.h>
#include <malloc.h>

#include <numbers>

#include "tests/support/allocation_count.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

using tests::pose_with;
using tests::posed_cloud;

constexpr double kDegree = std::numbers::pi / 180;

double main_joint_error(const FitResult& result, const BodyModel& truth, const ShapeVector& beta, const PoseVector& q) {
  Kinematics k;
  forward_kinematics(q, truth.bone_vectors(beta), k);
  double sum = 0;
  for (int j : main_joints()) sum += (result.joints.col(j) - k.joint.col(j)).norm();
  return sum / static_cast<double>(main_joints().size());
}

Eigen::Vector3d joint(const FitResult& r, const char* name) { return r.joints.col(joint_index(name)); }

class EstimatorTest : public testing::Test {
 protected:
  std::shared_ptr<const BodyModel> men = tests::capsule_body(Sex::men), women = tests::capsule_body(Sex::women);
  std::shared_ptr<const PosePrior> prior = tests::plain_prior();
  ShapeVector beta = ShapeVector::Zero(tests::kCapsuleShapes);

  std::unique_ptr<Estimator> make(EstimatorSettings settings = {.sex = SexChoice::men}) { return std::make_unique<Estimator>(men, women, prior, settings); }
};

TEST_F(EstimatorTest, ARaisedLeftArmComesOutAsTheLeftArm) {
  for (double heading : {0.0, 100.0, 190.0}) {
    PoseVector q = pose_with({{"lhumerus_rz", -60}, {"root_ry", heading}});
    const auto estimator = make();
    const FitResult& r = estimator->fit(posed_cloud(*men, beta, q));
    ASSERT_EQ(r.state, FitState::estimated);
    EXPECT_GT(joint(r, "lwrist").y(), joint(r, "lshoulder").y() + 0.2) << heading;
    EXPECT_LT(joint(r, "rwrist").y(), joint(r, "rshoulder").y() - 0.2) << heading;
    EXPECT_LT(main_joint_error(r, *men, beta, q), 0.03) << heading;
  }
}

TEST_F(EstimatorTest, SomebodyWhoLiesOnTheirSideIsFound) {
  // None of the prior's typical poses lies: the search lays them along the cloud.
  for (const double heading : {20.0, 160.0}) {
    const PoseVector q = pose_with({{"root_rz", 90}, {"root_ry", heading}, {"root_rx", 10}, {"lfemur_rx", -30}, {"ltibia_rx", 35}});
    const auto estimator = make();
    const FitResult& r = estimator->fit(posed_cloud(*men, beta, q));
    ASSERT_EQ(r.state, FitState::estimated);
    EXPECT_LT(main_joint_error(r, *men, beta, q), 0.04) << heading;
  }
}

TEST_F(EstimatorTest, TheMemoryPlanIsWhatConstructionTakes) {
  const auto held = [] {
    const struct mallinfo2 m = mallinfo2();
    return static_cast<double>(m.uordblks + m.hblkhd);
  };
  const double before = held();
  const auto estimator = make({.threads = 1});
  const double taken = held() - before;
  if (!(taken > 0)) GTEST_SKIP() << "skipped: this allocator does not say what it holds";
  EXPECT_GT(static_cast<double>(estimator->memory_bytes()), 0.9 * taken);
  EXPECT_LT(static_cast<double>(estimator->memory_bytes()), 1.15 * taken);
}

TEST_F(EstimatorTest, LearnsAnIndividualBody) {
  beta[0] = 1.5, beta[1] = -1;
  const PoseVector q = pose_with({{"lhumerus_rz", 40}, {"rhumerus_rz", -50}, {"root_ry", 30}});
  const auto estimator = make();
  const FitResult& r = estimator->fit(posed_cloud(*men, beta, q));
  ASSERT_EQ(r.state, FitState::estimated);
  EXPECT_LT(main_joint_error(r, *men, beta, q), 0.02);
  EXPECT_LT(r.cloud_to_model.mean, 0.005);
  EXPECT_NEAR(r.beta[0], beta[0], 0.5);
}

TEST_F(EstimatorTest, FollowsAMovingArm) {
  const auto estimator = make();
  PoseVector q = pose_with({{"lhumerus_rz", 60}});
  for (int frame = 0; frame < 40; ++frame) {
    q[dof_index("lhumerus_rz")] = (60 - 3 * frame) * kDegree;
    q[dof_index("root_ry")] = 0.5 * frame * kDegree;
    Observation o = posed_cloud(*men, beta, q, 0.004f, static_cast<std::uint64_t>(frame));
    o.frame = static_cast<std::uint64_t>(frame);
    o.time = frame / 30.0;
    const FitResult& r = estimator->step(o);
    EXPECT_EQ(r.state, frame == 0 ? FitState::estimated : FitState::tracked) << frame;
    EXPECT_LT(main_joint_error(r, *men, beta, q), 0.03) << frame;
  }
}

TEST_F(EstimatorTest, AnEmptyCloudIsNobodyAndThePersonIsFoundAgain) {
  const auto estimator = make();
  const PoseVector q = pose_with({{"rhumerus_rz", 30}});
  Observation person = posed_cloud(*men, beta, q), empty(10);
  EXPECT_EQ(estimator->step(empty).state, FitState::lost);
  EXPECT_EQ(estimator->step(person).state, FitState::estimated);
  for (int i = 0; i < 5; ++i) {
    empty.time = person.time + 0.033 * (i + 1);
    EXPECT_EQ(estimator->step(empty).state, FitState::lost);
  }
  person.time = 1;
  const FitResult& r = estimator->step(person);
  EXPECT_EQ(r.state, FitState::estimated);
  EXPECT_LT(main_joint_error(r, *men, beta, q), 0.03);
}

TEST_F(EstimatorTest, SameBitsForAnyNumberOfThreadsAndOnEveryRun) {
  for (Preset preset : {Preset::booth, Preset::paper}) {
    std::vector<PoseVector> poses;
    const bool paper = preset == Preset::paper;
    for (int threads : {1, 2, 4, 2}) {
      const auto estimator = make({.preset = preset, .sex = paper ? SexChoice::men : SexChoice::automatic, .threads = threads});
      PoseVector last = PoseVector::Zero();
      for (int frame = 0; frame < (paper ? 2 : 5); ++frame) {
        Observation o = posed_cloud(*men, beta, pose_with({{"lhumerus_rz", 60.0 - 4 * frame}}), 0.005f, 3);
        o.frame = static_cast<std::uint64_t>(frame), o.time = frame / 30.0;
        last = estimator->step(o).q;
      }
      poses.push_back(last);
    }
    for (const PoseVector& p : poses) EXPECT_EQ(p, poses.front()) << (paper ? "paper" : "booth");
  }
}

TEST_F(EstimatorTest, AllocatesNothingOnTheFramePath) {
  const auto estimator = make({.sex = SexChoice::automatic, .threads = 2});
  Observation empty(10);
  std::vector<Observation> frames;
  for (int i = 0; i < 6; ++i) {
    frames.push_back(posed_cloud(*men, beta, pose_with({{"lhumerus_rz", 60.0 - 3 * i}})));
    frames.back().time = i / 30.0;
  }
  if (!tests::AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  const tests::AllocationCount count;
  for (const Observation& o : frames) estimator->step(o);
  estimator->step(empty), estimator->step(empty), estimator->step(empty);
  estimator->reset();
  estimator->step(frames[0]);
  EXPECT_EQ(count.so_far(), 0u);
}

TEST_F(EstimatorTest, PresetPaperFindsAnAPose) {
  const PoseVector q = men->rest_pose();
  const auto estimator = make({.preset = Preset::paper, .sex = SexChoice::men});
  const FitResult& r = estimator->fit(posed_cloud(*men, beta, q));
  EXPECT_EQ(r.state, FitState::estimated);
  EXPECT_LT(main_joint_error(r, *men, beta, q), 0.12);
  EXPECT_GT(r.energy.point, 0);
  EXPECT_GT(r.energy.plane, 0);
}

TEST_F(EstimatorTest, SaysWhatIsMissing) {
  EXPECT_THROW(Estimator(nullptr, nullptr, prior, {}), std::invalid_argument);
  EXPECT_THROW(Estimator(men, women, nullptr, {}), std::invalid_argument);
  EXPECT_THROW(Estimator(men, nullptr, prior, {.sex = SexChoice::women}), std::invalid_argument);
}

}  // namespace
}  // namespace booth::fit
