// The live pipeline in real time: frames arrive, a slow fit drops groups but not the newest, lost cameras come back.
#include <gtest/gtest.h>

#include "daemon/pipeline/pipeline.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using tests::eventually;
using tests::FakeCamera;

struct CollectingSink final : FrameSink {
  void publish(FrameRecord&) noexcept override { ++published; }
  void log(const FrameRecord& record) noexcept override {
    const std::lock_guard lock(mutex);
    frames.push_back(record);
  }
  std::vector<FrameRecord> taken() {
    const std::lock_guard lock(mutex);
    return frames;
  }
  std::atomic<int> published{0};
  std::mutex mutex;
  std::vector<FrameRecord> frames;
};

struct LiveBooth : ::testing::Test {
  void build(int count, std::uint64_t frames = 1'000'000) {
    for (int i = 0; i < count; ++i) cameras.push_back(std::make_unique<FakeCamera>("c" + std::to_string(i), clock, i * 8ms, frames, true));
  }
  FakeCamera& camera(int i) { return static_cast<FakeCamera&>(*cameras[static_cast<std::size_t>(i)]); }

  drivers::SystemClock clock;
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  CollectingSink sink;
};

TEST_F(LiveBooth, FitsGroupsOfAllCamerasOnceActive) {
  build(4);
  Pipeline pipeline({.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, sink);
  ASSERT_TRUE(eventually([&] { return pipeline.cameras_running() == 4; }));
  EXPECT_EQ(sink.published, 0) << "nothing is fitted before it is asked for";
  pipeline.activate();
  ASSERT_TRUE(eventually([&] { return sink.taken().size() >= 10; }));
  pipeline.deactivate();
  const auto frames = sink.taken();
  std::this_thread::sleep_for(80ms);
  EXPECT_EQ(sink.taken().size(), frames.size()) << "the sink was called after deactivate()";
  std::uint64_t expected = 0;
  for (const auto& f : frames) {
    EXPECT_EQ(f.sequence, expected++);
    EXPECT_GT(f.published_ns, f.captured_ns);
    EXPECT_GT(f.captured_utc_ns, 1'700'000'000'000'000'000);
  }
  EXPECT_EQ(frames.back().cameras, 4);
  EXPECT_GE(pipeline.latency().count, 10u);
  EXPECT_GE(pipeline.latency().p50_ms, 8.0) << "the group's last frame comes 12 ms after its middle";
}

TEST_F(LiveBooth, ASlowFitDropsGroupsAndSaysSo) {
  build(2);
  fitter.busy = 120ms;
  Pipeline pipeline({.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, sink);
  pipeline.activate();
  ASSERT_TRUE(eventually([&] { return sink.taken().size() >= 5; }));
  const PipelineCounters counters = pipeline.counters();
  EXPECT_GE(counters.groups_dropped, 6u) << "about three of four groups are overtaken";
  for (const auto& f : sink.taken()) EXPECT_LT(f.stage_ns[static_cast<std::size_t>(Stage::wait)], 100'000'000) << "it is the newest that is fitted";
}

// However long the fit stands still: what it gets next is the newest there is, each group in between is counted, and no slot is lost on the way (a lost one
// would end the third standstill early).
TEST_F(LiveBooth, AfterAStandstillTheNewestGroupIsNext) {
  build(4);
  Pipeline pipeline({.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, sink);
  pipeline.activate();
  ASSERT_TRUE(eventually([&] { return sink.taken().size() >= 3; }));
  for (int standstill = 0; standstill < 3; ++standstill) {
    fitter.held = true;
    ASSERT_TRUE(eventually([&] { return fitter.holding.load(); }));
    const PipelineCounters before = pipeline.counters();
    ASSERT_TRUE(eventually([&] { return pipeline.counters().groups >= before.groups + 30; })) << "the cameras and the synchroniser go on";
    const std::size_t known = sink.taken().size();
    const PipelineCounters after = pipeline.counters();
    EXPECT_GE(after.groups_dropped - before.groups_dropped, 29u) << "of 30 groups one waits, the others are overtaken and counted";
    fitter.holding = false;
    fitter.held = false;
    ASSERT_TRUE(eventually([&] { return sink.taken().size() >= known + 2; }));
    const auto frames = sink.taken();
    // frames[known] is the one that was held; the next is what had been waiting.
    const auto next = hal::MonotonicTime(hal::Nanoseconds(frames[known + 1].captured_ns));
    EXPECT_LT(frames[known].captured_ns, frames[known + 1].captured_ns);
    EXPECT_GT(next, hal::MonotonicTime(hal::Nanoseconds(frames[known].captured_ns)) + 29 * 33ms) << "none of the overtaken ones is fitted";
  }
}

TEST_F(LiveBooth, ALostCameraComesBackAndTheOthersGoOn) {
  build(3);
  Pipeline pipeline({.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, sink);
  pipeline.activate();
  ASSERT_TRUE(eventually([&] { return pipeline.cameras_running() == 3; }));
  camera(1).lost = true;
  ASSERT_TRUE(eventually([&] { return pipeline.cameras_running() == 2; }));
  EXPECT_EQ(pipeline.cameras()[1].problem, "the cable was pulled");
  ASSERT_TRUE(eventually([&] { return !sink.taken().empty() && sink.taken().back().cameras == 2; }));
  camera(1).plug_in();
  ASSERT_TRUE(eventually([&] { return pipeline.cameras_running() == 3; }));
  ASSERT_TRUE(eventually([&] { return sink.taken().back().cameras == 3; }));
  EXPECT_GE(pipeline.cameras()[1].restarts, 1u);
}

TEST_F(LiveBooth, BelowTheMinimumNothingIsFitted) {
  build(2);
  camera(0).refuse_start = true;
  Pipeline pipeline({.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, sink);
  pipeline.activate();
  ASSERT_TRUE(eventually([&] { return pipeline.counters().groups_small >= 3; }));
  EXPECT_EQ(fitter.steps, 0);
  EXPECT_EQ(pipeline.cameras()[0].problem, "c0 is not plugged in");
  camera(0).refuse_start = false;
  ASSERT_TRUE(eventually([&] { return fitter.steps > 0; }));
}

TEST_F(LiveBooth, AFiniteSourceEnds) {
  build(2, 12);
  Pipeline pipeline({.minimum_cameras = 1, .synchroniser = {}}, cameras, clock, fitter, sink);
  pipeline.activate();
  ASSERT_TRUE(eventually([&] { return pipeline.all_ended(); }));
  EXPECT_EQ(camera(0).starts, 1) << "what has ended is not started again";
}

TEST_F(LiveBooth, EveryThreadsCounterMoves) {
  build(2);
  Pipeline pipeline({.minimum_cameras = 1, .synchroniser = {}}, cameras, clock, fitter, sink);
  const auto before = pipeline.progress();
  ASSERT_EQ(before.size(), 4u);
  ASSERT_TRUE(eventually([&] {
    const auto now = pipeline.progress();
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (now[i] == before[i]) return false;
    }
    return true;
  }));
}

}  // namespace
}  // namespace booth::daemon
