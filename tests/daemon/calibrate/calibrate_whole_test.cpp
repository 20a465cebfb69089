// The whole way of an installer with simulated views; long, and so apart.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "daemon/calibrate/calibration_store.hpp"
#include "tests/daemon/calibrate/calibrate_program.hpp"

namespace booth::tests {
namespace {

/// The whole way: simulated views, calibration, the truth, and a verification before and after a camera was turned.
TEST(CalibrateVerb, ASimulatedBoothIsCalibratedVerifiedAndFoundKnocked) {
  const CalibrateProgram p;
  ASSERT_EQ(p.run("--simulate views --views 28").status, 0);
  const Ran ran = p.run("--from views --out c.toml --by Ana --json");
  ASSERT_EQ(ran.status, 0) << ran.err;
  const auto found = daemon::load_calibration(p.path / "c.toml"), truth = daemon::load_calibration(p.path / "views/truth.toml");
  EXPECT_EQ(found.by, "Ana");
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LE((found.calibrated[i].booth_from_camera.translation - truth.calibrated[i].booth_from_camera.translation).norm(), 0.004) << i;
    EXPECT_LE(fit::calibrate::angle_between(found.calibrated[i].booth_from_camera.rotation, truth.calibrated[i].booth_from_camera.rotation),
              0.15 * EIGEN_PI / 180);
  }
  // One view, a floor board that all cameras see.
  ASSERT_EQ(std::system(("cd '" + p.path.string() +
                         "' && mkdir one && cp views/calibration.toml one && for c in front-left back-left back-right front-right; do "
                         "mkdir one/$c && for k in infrared depth; do cp views/$c/view-028.$k.png one/$c/view-000.$k.png; done; done")
                            .c_str()),
            0);
  EXPECT_EQ(p.run("--from one --out c.toml --verify").status, 0);
  // Knocked by a degree.
  daemon::CalibrationRecord knocked;
  knocked.cameras = found.cameras, knocked.result.cameras = found.calibrated, knocked.result.errors.camera.resize(4), knocked.square = *found.square;
  auto& turned = knocked.result.cameras[1].booth_from_camera;
  turned.rotation = fit::calibrate::rotation_by({0, 0, EIGEN_PI / 180}) * turned.rotation;
  daemon::store_calibration(p.path / "c.toml", knocked);
  const Ran bad = p.run("--from one --out c.toml --verify");
  EXPECT_EQ(bad.status, 1);
  EXPECT_THAT(bad.err, testing::HasSubstr("calibrate again"));
}

}  // namespace
}  // namespace booth::tests
