// Offline every frame counts, whatever the cameras' phases, and the result is the same each time.
#include <gtest/gtest.h>

#include "daemon/pipeline/offline_run.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/pacing/timeline.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;

hal::DepthCameras four(hal::Clock& clock, std::uint64_t frames) {
  hal::DepthCameras out;
  for (int i = 0; i < 4; ++i) out.push_back(std::make_unique<tests::FakeCamera>("c" + std::to_string(i), clock, i * 7ms, frames, false));
  return out;
}

/// A camera of a recording: no further ahead of the others than two frames, as drivers/recording plays it.
class PacedCamera final : public hal::DepthCamera {
 public:
  PacedCamera(std::shared_ptr<drivers::Timeline> timeline, int lane, std::vector<hal::Nanoseconds> instants)
      : timeline_(std::move(timeline)), lane_(lane), instants_(std::move(instants)) {
    description_.name = "paced-" + std::to_string(lane);
  }
  const hal::CameraDescription& description() const override { return description_; }
  void start() override {
    tell();
    timeline_->enter(lane_);
  }
  void stop() noexcept override { timeline_->leave(lane_); }
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    if (next_ == instants_.size()) return hal::ReadStatus::ended;
    if (timeline_->wait(lane_, instants_[next_], {}, timeout) != drivers::Timeline::Wait::due) return hal::ReadStatus::timeout;
    slot.sequence = next_;
    slot.captured = slot.received = drivers::Timeline::kFastOrigin + instants_[next_];
    ++next_;
    tell();
    return hal::ReadStatus::frame;
  }
  hal::CameraCounters counters() const override { return {.delivered = next_}; }
  std::string last_error() const override { return {}; }

 private:
  void tell() { timeline_->advance(lane_, next_ < instants_.size() ? instants_[next_] : hal::Nanoseconds{}, next_ == instants_.size()); }

  const std::shared_ptr<drivers::Timeline> timeline_;
  const int lane_;
  const std::vector<hal::Nanoseconds> instants_;
  std::size_t next_ = 0;
  hal::CameraDescription description_;
};

TEST(OfflineRun, GoesOnWhereACameraHasNoFramesForASecond) {
  const auto clock = std::make_shared<drivers::ManualClock>();
  const auto timeline = std::make_shared<drivers::Timeline>(drivers::Pace::fast, clock, 3, 66'666'666ns);
  // The first begins a second late, the second is away in the middle, the third ends early.
  std::vector<std::vector<hal::Nanoseconds>> instants(3);
  for (int i = 0; i < 90; ++i) {
    const auto at = [&](int lane) { return std::chrono::nanoseconds(33'333'333) * i + lane * 5ms; };
    if (i >= 30) instants[0].push_back(at(0));
    if (i < 40 || i >= 70) instants[1].push_back(at(1));
    if (i < 60) instants[2].push_back(at(2));
  }
  hal::DepthCameras cameras;
  for (int lane = 0; lane < 3; ++lane) cameras.push_back(std::make_unique<PacedCamera>(timeline, lane, instants[static_cast<std::size_t>(lane)]));
  tests::FakeFitter fitter;
  std::vector<std::int64_t> moments;
  std::size_t frames = 0;
  const OfflineCounters counters = run_offline(cameras, 1, fitter, [&](const FitInput&, const FrameRecord& record) {
    moments.push_back(record.captured_ns);
    frames += record.cameras;
    return true;
  });
  EXPECT_EQ(counters.frames, 60u + 60u + 60u);
  EXPECT_EQ(frames, counters.frames);
  EXPECT_EQ(counters.frames_unmatched, 0u);
  EXPECT_GE(counters.groups, 90u);
  EXPECT_LE(counters.groups, 93u) << "a camera that nobody waited for may come back in a group of its own";
  EXPECT_TRUE(std::is_sorted(moments.begin(), moments.end()));
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
