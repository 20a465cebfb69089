// What a person says of cameras, where body, motion and cameras are exact: steps and delays come out, whoever pulled the fit, and nothing is allocated.
#include "fit/calibrate/person_system.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fit/calibrate/drift_watch.hpp"
#include "tests/support/allocation_count.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
const Eigen::Vector3d kPivot(0, 1, 0);

/// Four cameras around somebody who turns, bends and swings arms and legs.
struct Booth {
  std::shared_ptr<const BodyModel> model = tests::capsule_body();
  std::array<Vector6, 4> step{};         ///< that puts each camera's points right
  std::array<double, 4> late{};          ///< seconds
  std::array<bool, 4> covered{};         ///< sees nothing
  PoseVector pull = PoseVector::Zero();  ///< what the fitted pose is wrong by
  Poser poser{*model, model->shape_count(), model->vertex_count()};
  Observation observation{20000};
  FitResult result;

  Booth() {
    for (auto& s : step) s.setZero();
    observation.views.resize(4);
    for (std::size_t c = 0; c < 4; ++c) {
      Camera& camera = observation.views[c].camera;
      const double angle = (45 + 90 * static_cast<double>(c)) * kDegree;
      const Eigen::Vector3d z = -Eigen::Vector3d(std::sin(angle), 0, std::cos(angle)), y(0, -1, 0), x = y.cross(z);
      camera.width = 512, camera.height = 424, camera.fx = camera.fy = 365, camera.cx = 256, camera.cy = 212;
      camera.rotation << x.transpose().cast<float>(), y.transpose().cast<float>(), z.transpose().cast<float>();
      camera.translation = -camera.rotation * (kPivot - 2.8 * z).cast<float>();
    }
    poser.set_shape(ShapeVector::Zero(model->shape_count()));
    result.state = FitState::tracked;
    result.body_accepted = true;
    result.beta = ShapeVector::Zero(model->shape_count());
  }

  static PoseVector pose(double t) {
    const double w = 2 * std::numbers::pi;
    PoseVector q = tests::pose_with({{"lhumerus_rx", 40 * std::sin(w * t)},
                                     {"rhumerus_rx", -40 * std::sin(w * t)},
                                     {"lfemur_rx", -25 * std::sin(w * t)},
                                     {"rfemur_rx", 25 * std::sin(w * t)},
                                     {"lhumerus_rz", -40 + 25 * std::sin(0.7 * w * t)},
                                     {"root_rx", 15 * std::sin(0.4 * w * t)},
                                     {"root_ry", 60 * std::sin(0.25 * w * t)}});
    q[0] = 0.25 * std::sin(0.5 * w * t);
    q[2] = 0.25 * std::cos(0.37 * w * t);
    return q;
  }

  void see(int frame) {
    const double t = frame / 30.0;
    observation.frame = static_cast<std::uint64_t>(frame);
    observation.time = 100 + t;
    observation.cloud.clear();
    for (std::size_t c = 0; c < 4; ++c) {
      View& view = observation.views[c];
      view.valid = true;
      view.time_offset = static_cast<float>(0.004 * static_cast<double>(c) - 0.006);
      if (covered[c]) continue;
      poser.set_pose(pose(t + static_cast<double>(view.time_offset) - late[c]));
      const Eigen::Vector3f centre = view.camera.centre(), turn = step[c].head<3>().cast<float>(), shift = step[c].tail<3>().cast<float>();
      for (int i = 0; i < poser.size(); ++i) {
        const Eigen::Vector3f x = poser.position(i), n = poser.normal(i);
        if (n.dot(centre - x) < 0.3f * (centre - x).norm()) continue;
        const Eigen::Vector3f p = x - shift - turn.cross(x - shift - kPivot.cast<float>());
        for (int copy = 0; copy < 3; ++copy) observation.cloud.push(p, n, static_cast<std::uint8_t>(c));
      }
    }
    result.q = pose(t) + pull;
    result.joints.setZero();
    result.joints.colwise() = Eigen::Vector3d(result.q[0], 1.2, result.q[2]);
  }

  void run(PersonSystem& system, int seconds) {
    for (int k = 0; k < 30 * seconds; ++k) {
      see(k);
      if (system.observe(observation, result) && k % 30 == 0) system.solve();
    }
    system.solve();
  }
};

PersonSystemSettings settings() {
  PersonSystemSettings out;
  out.pivot = kPivot;
  return out;
}

TEST(PersonSystem, CamerasThatAgreeStand) {
  Booth booth;
  PersonSystem system(booth.model, nullptr, settings());
  booth.run(system, 8);
  for (int c = 0; c < 4; ++c) {
    const CameraSays& says = system.cameras()[static_cast<std::size_t>(c)];
    EXPECT_LT(says.displacement, 0.0015) << c;
    EXPECT_LT(std::abs(says.late), 0.0005) << c;
    EXPECT_GT(says.deviation, 0) << c;
    EXPECT_EQ(says.missed, 0) << c;
  }
}

TEST(PersonSystem, TheCameraThatMovedMovesAndTheOthersStay) {
  Booth booth;
  booth.step[2] << 0.3 * kDegree, 0.5 * kDegree, -1 * kDegree, 0.02, -0.01, 0.015;
  // The fit goes some of the way with it.
  booth.pull.head<3>() = -0.25 * booth.step[2].tail<3>();
  PersonSystem system(booth.model, nullptr, settings());
  booth.run(system, 8);
  const CameraSays& says = system.cameras()[2];
  EXPECT_LT(displacement_of(says.step - booth.step[2]), 0.003) << says.step.transpose();
  for (const std::size_t c : {0u, 1u, 3u}) EXPECT_LT(system.cameras()[c].displacement, 0.003) << c;
}

TEST(PersonSystem, DelaysComeOutToAMillisecond) {
  Booth booth;
  booth.late = {0.004, -0.006, 0.002, 0};
  PersonSystem system(booth.model, nullptr, settings());
  booth.run(system, 10);
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(system.cameras()[c].late, booth.late[c], 0.001) << c;
    EXPECT_LT(system.cameras()[c].displacement, 0.003) << c;
  }
}

TEST(PersonSystem, SomebodyElseTakesTheShapeAlongAndLeavesTheCameras) {
  Booth booth;
  booth.step[1] << 0, 0, 0, 0.02, 0, 0.02;
  PersonSystem system(booth.model, nullptr, settings());
  booth.run(system, 6);
  const Vector6 before = system.cameras()[1].step;
  system.new_person();
  system.solve();
  EXPECT_LT(displacement_of(system.cameras()[1].step - before), 0.002);
}

TEST(PersonSystem, NothingIsLearntOfFramesThatAreNotFollowed) {
  Booth booth;
  PersonSystem system(booth.model, nullptr, settings());
  for (int k = 0; k < 90; ++k) {
    booth.see(k);
    booth.result.state = k % 3 == 0 ? FitState::lost : FitState::tracked;
    EXPECT_FALSE(system.observe(booth.observation, booth.result));
  }
  system.solve();
  EXPECT_EQ(system.cameras()[0].moments, 0);
}

TEST(PersonSystem, RefusesSettingsThatMakeNoSense) {
  PersonSystemSettings bad = settings();
  bad.cameras = 9;
  EXPECT_THROW(PersonSystem(tests::capsule_body(), nullptr, bad), std::invalid_argument);
  EXPECT_THROW(PersonSystem(nullptr, nullptr, settings()), std::invalid_argument);
}

TEST(DriftWatch, NamesTheCameraThatIsKnockedAndTakesItBack) {
  Booth booth;
  DriftWatch watch(booth.model, nullptr, settings());
  const auto named = [&] {
    std::vector<int> out;
    for (int c = 0; c < 4; ++c)
      if (watch.camera(c).verdict == CameraVerdict::moved) out.push_back(c);
    return out;
  };
  int k = 0;
  const auto run = [&](int seconds, bool until_named) {
    for (const int end = k + 30 * seconds; k < end; ++k) {
      booth.see(k);
      watch.observe(booth.observation, booth.result);
      if (until_named && !named().empty()) return;
    }
  };
  run(10, false);
  EXPECT_EQ(named(), std::vector<int>{});
  EXPECT_EQ(watch.camera(0).verdict, CameraVerdict::stands);
  booth.step[3] << 0, 0, 0, 0, 0.02, 0;
  const int knocked = k;
  run(30, true);
  EXPECT_EQ(named(), std::vector<int>{3});
  EXPECT_LT((k - knocked) / 30.0, 30);
  booth.step[3].setZero();
  run(40, false);
  EXPECT_EQ(named(), std::vector<int>{});
}

TEST(DriftWatch, ACameraThatSeesNobodyIsBlind) {
  Booth booth;
  booth.covered[1] = true;
  DriftWatch watch(booth.model, nullptr, settings());
  for (int k = 0; k < 12 * 30; ++k) {
    booth.see(k);
    watch.observe(booth.observation, booth.result);
  }
  EXPECT_EQ(watch.camera(1).verdict, CameraVerdict::blind);
  for (const int c : {0, 2, 3}) EXPECT_EQ(watch.camera(c).verdict, CameraVerdict::stands) << c;
}

TEST(DriftWatch, AllocatesNothing) {
  if (!tests::AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  Booth booth;
  DriftWatch watch(booth.model, nullptr, settings());
  std::uint64_t seen = 0;
  for (int k = 0; k < 150; ++k) {
    booth.see(k);
    const tests::AllocationCount count;
    watch.observe(booth.observation, booth.result);
    if (k == 100) watch.new_person();
    seen += count.so_far();
  }
  EXPECT_EQ(seen, 0u);
}

}  // namespace
}  // namespace booth::fit::calibrate
