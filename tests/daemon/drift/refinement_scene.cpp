// The simulated booth of the configuration, opened anew for each pass.
#include "tests/daemon/drift/refinement_scene.hpp"

#include <gtest/gtest.h>

#include <iostream>
#include <numbers>

#include "daemon/calibrate/view_collector.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "fit/calibrate/rigid.hpp"
#include "tests/daemon/drift/drift_scene.hpp"

namespace booth::tests {

constexpr double kDegree = std::numbers::pi / 180;

daemon::RefinementInput input_of(const std::string& motion, double seconds, const std::array<double, 4>& late) {
  daemon::RefinementInput input;
  input.config.cameras.synthetic.body = "test:31";
  input.config.cameras.synthetic.motion = motion;
  input.config.cameras.synthetic.seconds = 0;
  input.config.fit.threads = 1;
  input.open = [config = input.config, seconds, late] {
    auto source = daemon::open_synthetic_source(config, seconds);
    std::vector<double> early;
    for (const double l : late) early.push_back(-l);
    source.cameras = daemon::punctual_cameras(std::move(source.cameras), early);
    return source;
  };
  for (const auto& camera : input.open().cameras) input.cameras.push_back(camera->description());
  return input;
}

double error_at_stage(const hal::CameraDescription& now, const hal::CameraDescription& truth) {
  const auto change = daemon::rigid_of(now.camera_to_world) * daemon::rigid_of(truth.camera_to_world).inverse();
  double most = 0;
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0, 0, 0.2), Eigen::Vector3d(0.2, 0, 1), Eigen::Vector3d(0, -0.2, 1.7)})
    most = std::max(most, (change * p - p).norm());
  return most;
}

void put_right(const std::string& motion, double seconds, int passes, double share) {
  const std::array<double, 4> late{0.005, -0.004, 0.003, -0.004};
  auto input = input_of(motion, seconds, late);
  const auto truth = input.cameras;
  fit::calibrate::Vector6 knock;
  knock << 0, 0.3 * kDegree, 0.5 * kDegree, 0.01, 0, -0.005;
  input.cameras[2] = moved(input.cameras[2], knock);
  input.passes = passes;
  input.say = [](const std::string& line) { std::cout << line << "\n"; };
  const double before = error_at_stage(input.cameras[2], truth[2]);
  const daemon::PersonRefinement r = daemon::refine_from_person(input);
  std::cout << r.sentence << "\n";
  EXPECT_TRUE(r.better) << r.sentence;
  EXPECT_LT(r.residual_after, r.residual_before);
  for (std::size_t c = 0; c < 4; ++c) {
    const double error = error_at_stage(r.cameras[c], truth[c]);
    std::cout << "camera " << c << ": " << 1e3 * error << " mm (the knocked one was off by " << 1e3 * before << "), late " << 1e3 * r.change[c].late
              << " ms, truth " << 1e3 * late[c] << "\n";
    EXPECT_LT(error, share * before) << c;
    EXPECT_NEAR(r.change[c].late, late[c], 0.003) << c;
  }
}

}  // namespace booth::tests
