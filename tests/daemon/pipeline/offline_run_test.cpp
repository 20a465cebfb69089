// Offline every frame counts, whatever the cameras' phases, and the result is the same each time.
#include <gtest/gtest.h>

#include "daemon/pipeline/offline_run.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;

hal::DepthCameras four(hal::Clock& clock, std::uint64_t frames) {
  hal::DepthCameras out;
  for (int i = 0; i < 4; ++i) out.push_back(std::make_unique<tests::FakeCamera>("c" + std::to_string(i), clock, i * 7ms, frames, false));
  return out;
}

TEST(OfflineRun, UsesEveryFrameInOrder) {
  drivers::ManualClock clock;
  auto cameras = four(clock, 25);
  tests::FakeFitter fitter;
  std::vector<std::int64_t> instants;
  const OfflineCounters counters = run_offline(cameras, 1, fitter, [&](const FitInput& input, const FrameRecord& record) {
    EXPECT_EQ(record.cameras, 4);
    for (int cam = 0; cam < 4; ++cam) EXPECT_EQ(input.frames[static_cast<std::size_t>(cam)]->sequence, input.frame);
    instants.push_back(record.captured_ns);
    return true;
  });
  EXPECT_EQ(counters.groups, 25u);
  EXPECT_EQ(counters.frames, 100u);
  EXPECT_EQ(counters.frames_unmatched, 0u);
  EXPECT_TRUE(std::is_sorted(instants.begin(), instants.end()));
  EXPECT_EQ(fitter.resets, 1);
}

TEST(OfflineRun, EndsWhenTheCallerHasEnough) {
  drivers::ManualClock clock;
  auto cameras = four(clock, 1000);
  tests::FakeFitter fitter;
  int seen = 0;
  run_offline(cameras, 1, fitter, [&](const FitInput&, const FrameRecord&) { return ++seen < 5; });
  EXPECT_EQ(seen, 5);
}

TEST(OfflineRun, SaysWhichCameraWasLost) {
  drivers::ManualClock clock;
  auto cameras = four(clock, 10);
  static_cast<tests::FakeCamera&>(*cameras[2]).lost = true;
  tests::FakeFitter fitter;
  EXPECT_THROW(run_offline(cameras, 1, fitter, [](const FitInput&, const FrameRecord&) { return true; }), std::runtime_error);
}

}  // namespace
}  // namespace booth::daemon
