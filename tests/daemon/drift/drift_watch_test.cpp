// The drift watch on rendered depth images with the noise of a Kinect v2: a camera that is knocked is named, cameras that stand are not.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/daemon/drift/drift_scene.hpp"

namespace booth::tests {
namespace {

using Verdict = daemon::CameraDriftStatus::Verdict;
constexpr double kDegree = std::numbers::pi / 180;

/// What the fitter itself says, as boothd would ask it; ends as soon as a camera is off.
struct Seen {
  double first = -1;  ///< seconds
  std::vector<int> named;
  std::vector<daemon::CameraDriftStatus> last;
};

Seen watch(const DriftScene& scene) {
  Seen out;
  play(scene, [&](const DriftFrame& f) {
    out.last = f.fitter->drift();
    for (std::size_t c = 0; c < out.last.size(); ++c)
      if (out.last[c].verdict == Verdict::moved || out.last[c].verdict == Verdict::blind) out.named.push_back(static_cast<int>(c));
    if (!out.named.empty()) out.first = f.time;
    return out.named.empty();
  });
  return out;
}

TEST(DriftOfRenderedCameras, ATurnOfOneDegreeIsNamed) {
  DriftScene scene{.body = 31, .motion = "walk", .seconds = 8 + 30, .knocked = 1, .knocked_at = 8};
  scene.knock << 0, 0, 1 * kDegree, 0, 0, 0;
  const Seen seen = watch(scene);
  EXPECT_EQ(seen.named, std::vector<int>{1});
  EXPECT_GT(seen.first, scene.knocked_at);
}

TEST(DriftOfRenderedCameras, AShiftOfTwoCentimetresIsNamed) {
  DriftScene scene{.body = 3, .motion = "wave", .seconds = 8 + 30, .knocked = 2, .knocked_at = 8};
  scene.knock << 0, 0, 0, 0, 0, 0.02;
  const Seen seen = watch(scene);
  EXPECT_EQ(seen.named, std::vector<int>{2});
  EXPECT_GT(seen.first, scene.knocked_at);
}

TEST(DriftOfRenderedCameras, CamerasThatStandAreNot) {
  const Seen seen = watch({.body = 52, .motion = "kick", .seconds = 14, .seed = 5});
  EXPECT_TRUE(seen.named.empty());
  ASSERT_EQ(seen.last.size(), 4u);
  for (const auto& camera : seen.last) EXPECT_EQ(camera.verdict, Verdict::stands);
}

TEST(DriftOfRenderedCameras, TheNextPersonsShapeIsNotTheFirstOnes) {
  DriftScene scene{.body = 31, .motion = "wave", .seconds = 8, .next = 71, .gone_at = 1.5};
  int edges = 0, given_up = 0;
  bool accepted = false, given_up_before = false;
  play(scene, [&](const DriftFrame& f) {
    if (f.record->person != daemon::PersonState::lost) {
      edges += f.record->body_accepted != 0 && !accepted;
      accepted = f.record->body_accepted != 0;
    }
    given_up = f.fitter->given_up();
    if (f.time < scene.gone_at) given_up_before |= given_up > 0;
    return edges < 2;
  });
  EXPECT_EQ(edges, 2) << "both were met";
  EXPECT_FALSE(given_up_before) << "nobody had gone yet";
  EXPECT_EQ(given_up, 1) << "the watch was told, before it heard of the second body";
}

}  // namespace
}  // namespace booth::tests
