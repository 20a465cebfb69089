// Cameras put right by a person: what was knocked and late comes out, what is right is left alone, and the file keeps what it had.
#include "daemon/calibrate/person_refinement.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/calibrate/refined_calibration.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "tests/daemon/drift/drift_scene.hpp"
#include "tests/daemon/drift/refinement_scene.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

using ::testing::HasSubstr;

TEST(PersonRefinement, PutsRightWhatWasKnockedAndLate) { put_right("walk", 17.5, 2, 0.4); }

TEST(PersonRefinement, TooLittleIsRefused) {
  const auto input = input_of("walk", 5, {});
  const daemon::PersonRefinement r = daemon::refine_from_person(input);
  EXPECT_FALSE(r.better);
  EXPECT_THAT(r.sentence, HasSubstr("at least 20 s"));
  EXPECT_EQ(r.cameras[0].camera_to_world.translation, input.cameras[0].camera_to_world.translation);
}

struct RefinedFile : ::testing::Test {
  TemporaryFolder folder;
  std::vector<hal::CameraDescription> cameras = daemon::simulated_cameras(1).planned;
  std::filesystem::path file = folder.path / "calibration.toml";
  daemon::PersonRefinement refinement;

  void write(const std::string& more = {}) {
    std::string text = "# by hand\nversion = 1\n\n[calibration]\nutc = \"2026-11-01T00:00:00Z\"\nby = \"Zoë\"  # who\n";
    for (const auto& camera : cameras) text += daemon::camera_table(camera) + more + "depth_gain = 0.001  # stays\n";
    folder.write("calibration.toml", text);
  }
  RefinedFile() {
    refinement.better = true;
    refinement.cameras = cameras;
    refinement.change.resize(cameras.size());
    fit::calibrate::Vector6 step;
    step << 0.01, 0.02, -0.01, 0.01, -0.02, 0.03;
    refinement.cameras[1] = moved(cameras[1], step);
    refinement.change[1].late = 0.0025;
    refinement.change[3].late = -0.001;
  }
  daemon::RefinementOrigin origin{.utc = "2026-11-28T12:00:00Z", .by = "me", .software = "test", .recording = "one"};
};

TEST_F(RefinedFile, ChangesPlacesAndDelaysAndNothingElse) {
  write("time_offset_ms = 1.5\n");
  daemon::store_refined_calibration(file, refinement, origin);
  const auto now = daemon::read_cameras(file);
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_EQ(now[c].camera_to_world.rotation, refinement.cameras[c].camera_to_world.rotation) << c;
    EXPECT_EQ(now[c].camera_to_world.translation, refinement.cameras[c].camera_to_world.translation) << c;
    EXPECT_EQ(now[c].intrinsics.fx, cameras[c].intrinsics.fx);
  }
  const auto late = daemon::read_time_offsets(file);
  EXPECT_NEAR(late[0], 0.0015, 1e-12);
  EXPECT_NEAR(late[1], 0.004, 1e-12);
  EXPECT_NEAR(late[3], 0.0005, 1e-12);
  const std::string text = read_text(file);
  for (const char* part : {"# by hand", "by = \"Zoë\"  # who", "depth_gain = 0.001  # stays", "[[refinement]]", "utc = \"2026-11-28T12:00:00Z\""})
    EXPECT_THAT(text, HasSubstr(part));
  EXPECT_TRUE(std::filesystem::exists(folder.path / "calibration.before-20261101T000000Z.toml"));
  // And again: a second refinement stands beside the first.
  origin.utc = "2026-11-28T13:00:00Z";
  daemon::store_refined_calibration(file, refinement, origin);
  EXPECT_NEAR(daemon::read_time_offsets(file)[1], 0.0065, 1e-12);
  EXPECT_TRUE(std::filesystem::exists(folder.path / "calibration.before-20261128T120000Z.toml"));
}

TEST_F(RefinedFile, AddsADelayWhereThereWasNone) {
  write();
  daemon::store_refined_calibration(file, refinement, origin);
  EXPECT_NEAR(daemon::read_time_offsets(file)[1], 0.0025, 1e-12);
  EXPECT_EQ(daemon::read_time_offsets(file)[0], 0);
}

TEST_F(RefinedFile, RefusesAndLeavesTheFileAlone) {
  write();
  const std::string before = read_text(file);
  refinement.cameras[0].name = "stranger";
  EXPECT_THROW(daemon::store_refined_calibration(file, refinement, origin), std::runtime_error);
  refinement.cameras[0].name = cameras[0].name;
  refinement.better = false;
  EXPECT_THROW(daemon::store_refined_calibration(file, refinement, origin), std::invalid_argument);
  EXPECT_EQ(read_text(file), before);
}

TEST_F(RefinedFile, ADelayBeyondReasonIsRefused) {
  write("time_offset_ms = 51\n");
  try {
    (void)daemon::read_time_offsets(file);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("time_offset_ms must be from -50 to 50"));
  }
}

}  // namespace
}  // namespace booth::tests
