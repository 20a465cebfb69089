// The whole way of an installer through the program: simulated views, a calibration, the truth, a camera that was knocked.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/calibrate/calibration_store.hpp"
#include "tests/daemon/calibrate/calibrate_program.hpp"

namespace booth::tests {
namespace {

/// Where the cameras stand to each other; in the booth's frame the board on the floor of 4 m is good for a third of a degree (docs/design/calibration.md).
TEST(CalibrateVerb, ASimulatedBoothIsCalibratedAndAKnockedCameraIsFound) {
  const CalibrateProgram p;
  ASSERT_EQ(p.run("--simulate views --views 28").status, 0);
  const Ran ran = p.run("--from views --out c.toml --by Ana --json");
  ASSERT_EQ(ran.status, 0) << ran.err;
  const auto found = daemon::load_calibration(p.path / "c.toml"), truth = daemon::load_calibration(p.path / "views/truth.toml");
  EXPECT_EQ(found.by, "Ana");
  ASSERT_EQ(found.calibrated.size(), 4u);
  const auto between = [](const daemon::StoredCalibration& c, std::size_t i) {
    return c.calibrated[0].booth_from_camera.inverse() * c.calibrated[i].booth_from_camera;
  };
  for (std::size_t i = 1; i < 4; ++i) {
    const auto is = between(found, i), should = between(truth, i);
    std::printf("camera %zu: %.2f mm, %.3f degrees\n", i, 1000 * (is.translation - should.translation).norm(),
                fit::calibrate::angle_between(is.rotation, should.rotation) * (180 / 3.14159265358979));
    EXPECT_LE((is.translation - should.translation).norm(), 0.004) << i;
    EXPECT_LE(fit::calibrate::angle_between(is.rotation, should.rotation), 0.15 * EIGEN_PI / 180) << i;
  }
  ASSERT_EQ(p.run("--simulate later --views 2").status, 0);
  const Ran good = p.run("--from later --out c.toml --verify");
  EXPECT_EQ(good.status, 0) << good.err;

  daemon::CalibrationRecord knocked;
  knocked.cameras = found.cameras, knocked.result.cameras = found.calibrated, knocked.result.errors.camera.resize(4), knocked.square = *found.square;
  auto& turned = knocked.result.cameras[1].booth_from_camera;
  turned.rotation = fit::calibrate::rotation_by({0, 0, EIGEN_PI / 180}) * turned.rotation;
  daemon::store_calibration(p.path / "c.toml", knocked);
  const Ran bad = p.run("--from later --out c.toml --verify");
  EXPECT_EQ(bad.status, 1);
  EXPECT_THAT(bad.err, testing::HasSubstr("calibrate again"));
}

}  // namespace
}  // namespace booth::tests
