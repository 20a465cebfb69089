// Four cameras on emulated sensors, one of which dies every few seconds: what the others, the memory, the status and the log make of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "daemon/health/repeated_log.hpp"
#include "daemon/pipeline/camera_worker.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/kinect_camera.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
namespace kinect2 = drivers::kinect2;

double resident_megabytes() {
  std::ifstream statm("/proc/self/statm");
  double total = 0, resident = 0;
  statm >> total >> resident;
  return resident * 4096 / 1e6;
}
int open_descriptors() { return static_cast<int>(std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator())); }
int threads() { return static_cast<int>(std::distance(std::filesystem::directory_iterator("/proc/self/task"), std::filesystem::directory_iterator())); }

class DyingCamera : public testing::Test {
 protected:
  static constexpr int kCameras = 4, kDying = 2;

  DyingCamera() {
    for (int i = 0; i < kCameras; ++i) {
      const std::string serial = "00000000000" + std::to_string(i + 1);
      bus_->add({.serial = serial,
                 .rate = 10,
                 .camera = kinect2::emulator::typical_camera(),
                 .still = true,
                 .view = [](hal::MonotonicTime, std::span<float> depth, std::span<float> infrared) {
                   std::fill(depth.begin(), depth.end(), 2000.0f);
                   std::fill(infrared.begin(), infrared.end(), 5000.0f);
                 }});
      kinect2::KinectShared shared{.bus = bus_, .clock = clock_, .gate = gate_};
      cameras_.push_back(kinect2::make_kinect_camera(shared, {.index = hal::CameraIndex(static_cast<std::uint8_t>(i)), .serial = serial, .name = serial}));
      workers_.push_back(std::make_unique<CameraWorker>(*cameras_.back(), hal::CameraIndex(static_cast<std::uint8_t>(i)), *clock_, bell_));
    }
  }
  /// Takes frames as the synchroniser does and notes the largest gap between two of each camera.
  void take_frames() {
    const auto now = std::chrono::steady_clock::now();
    for (std::size_t i = 0; i < kCameras; ++i)
      for (int slot = 0; workers_[i]->take(slot); workers_[i]->give_back(slot)) {
        const auto captured = workers_[i]->frame(slot).captured;
        if (frames_[i]++ > 0) gap_[i] = std::max(gap_[i], hal::seconds(captured - last_[i]));
        last_[i] = captured;
      }
    for (std::size_t i = 0; i < kCameras; ++i) {
      const auto status = workers_[i]->status();
      if (status.state == CameraState::lost && !status.problem.empty() && status.problem != problems_[i])
        log_.say(LogLevel::warning, problems_[i] = status.problem, hal::MonotonicTime(now.time_since_epoch()));
      if (status.state == CameraState::running) problems_[i].clear();
    }
  }
  void run(std::chrono::milliseconds duration) {
    const auto end = std::chrono::steady_clock::now() + duration;
    while (std::chrono::steady_clock::now() < end) {
      bell_.wait(5ms);
      take_frames();
    }
  }
  bool run_until(const std::function<bool()>& condition, std::chrono::seconds limit = 60s) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      run(20ms);
    }
    return true;
  }
  CameraState state(int i) const { return workers_[static_cast<std::size_t>(i)]->state(); }
  /// One death and resurrection: pulled out, stalled, or refusing commands, in turn.
  void die(int round) {
    switch (round % 3) {
      case 0:
        bus_->unplug(kDying);
        break;
      case 1:
        bus_->faults(kDying).inject(kinect2::emulator::Fault::stream_stalls);
        break;
      default:
        bus_->faults(kDying).inject(kinect2::emulator::Fault::command_timeout, 4);
        bus_->unplug(kDying);
    }
    EXPECT_TRUE(run_until([&] { return state(kDying) == CameraState::lost; })) << "round " << round;
    EXPECT_TRUE(run_until([&] { return !workers_[kDying]->status().problem.empty(); }));
    if (round % 3 != 1) bus_->plug(kDying);
    EXPECT_TRUE(run_until([&] { return state(kDying) == CameraState::running; })) << "round " << round << ": " << workers_[kDying]->status().problem;
    EXPECT_TRUE(run_until([&] { return workers_[kDying]->status().problem.empty(); }));
  }
  void expect_the_others_well() {
    for (std::size_t i = 0; i < kCameras; ++i) {
      if (i == kDying) continue;
      EXPECT_EQ(workers_[i]->status().restarts, 0u);
      EXPECT_EQ(cameras_[i]->counters().restarts, 0u);
      EXPECT_EQ(state(static_cast<int>(i)), CameraState::running);
      EXPECT_EQ(workers_[i]->status().problem, "");
      EXPECT_LT(gap_[i], 1.8) << "the time after which a stream counts as stalled";
    }
  }
  double largest_gap() const { return std::max({gap_[0], gap_[1], gap_[3]}); }

  const std::shared_ptr<drivers::SystemClock> clock_ = std::make_shared<drivers::SystemClock>();
  const std::shared_ptr<kinect2::ResetGate> gate_ = std::make_shared<kinect2::ResetGate>(100ms);
  const std::shared_ptr<kinect2::emulator::EmulatedBus> bus_ = kinect2::emulator::make_emulated_bus(clock_, {.reboot = 500ms, .close = 500ms});
  Wakeup bell_;
  hal::DepthCameras cameras_;
  std::vector<std::unique_ptr<CameraWorker>> workers_;
  std::array<std::uint64_t, kCameras> frames_{};
  std::array<double, kCameras> gap_{};
  std::array<hal::MonotonicTime, kCameras> last_{};
  std::array<std::string, kCameras> problems_{};
  std::vector<std::string> lines_;
  RepeatedLog log_{10min, [this](LogLevel, const std::string& line) { lines_.push_back(line); }};
};

TEST_F(DyingCamera, HoldsUpNoOtherCamera) {
  ASSERT_TRUE(run_until([&] { return std::all_of(workers_.begin(), workers_.end(), [](const auto& w) { return w->state() == CameraState::running; }); }));
  for (int round = 0; round < 3; ++round) die(round);
  expect_the_others_well();
}

/// The long form: BOOTHD_DYING_SECONDS=120 (a command of its own; see docs/reference/kinect2.md).
TEST_F(DyingCamera, MemoryDoesNotGrowAndTheLogStaysShortForMinutes) {
  const char* text = std::getenv("BOOTHD_DYING_SECONDS");
  if (text == nullptr) GTEST_SKIP() << "takes minutes: set BOOTHD_DYING_SECONDS to how many seconds it may last";
  ASSERT_TRUE(run_until([&] { return std::all_of(workers_.begin(), workers_.end(), [](const auto& w) { return w->state() == CameraState::running; }); }));
  for (int round = 0; round < 3; ++round) die(round);
  const double before = resident_megabytes();
  const int descriptors = open_descriptors(), tasks = threads();
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::atoi(text));
  int round = 0;
  for (; std::chrono::steady_clock::now() < end; ++round) {
    die(round);
    run(1s);
  }
  expect_the_others_well();
  const double grown = resident_megabytes() - before;
  EXPECT_LT(grown, 8) << "megabytes; one leaked frame or stream would be 3 to 9 for each of " << round << " deaths";
  EXPECT_EQ(open_descriptors(), descriptors);
  EXPECT_EQ(threads(), tasks);
  EXPECT_LE(lines_.size(), 12u) << "each cause once";
  std::printf("%d deaths; largest gap of the other cameras %.0f ms at 100 ms between frames; memory %+.1f MB; %zu log lines; ", round, 1e3 * largest_gap(),
              grown, lines_.size());
  std::printf("restarts of the dying camera %u\n", workers_[kDying]->status().restarts);
  for (const auto& line : lines_) std::printf("  %s\n", line.c_str());
}

TEST(RepeatedLog, SaysEachCauseOnceAndCountsTheRest) {
  std::vector<std::string> lines;
  const auto write = [&](LogLevel, const std::string& line) { lines.push_back(line); };
  {
    RepeatedLog log(10min, write);
    const hal::MonotonicTime start(1h);
    EXPECT_TRUE(log.say(LogLevel::warning, "camera a: left the bus (3 other sensors are)", start));
    for (int i = 0; i < 40; ++i)
      EXPECT_FALSE(log.say(LogLevel::warning, "camera a: left the bus (" + std::to_string(i % 4) + " other sensors are)", start + 1s));
    EXPECT_TRUE(log.say(LogLevel::warning, "camera b: left the bus (3 other sensors are)", start)) << "another camera";
    log.tell(start + 9min);
    EXPECT_EQ(lines.size(), 2u);
    log.tell(start + 10min);
    ASSERT_EQ(lines.size(), 3u);
    EXPECT_EQ(lines.back(), "camera a: left the bus (3 other sensors are) (again, 40 times)");
    log.tell(start + 21min);
    EXPECT_EQ(lines.size(), 3u) << "nothing new";
    EXPECT_FALSE(log.say(LogLevel::warning, "camera a: left the bus (1 other sensors are)", start + 19min));
    EXPECT_TRUE(log.say(LogLevel::warning, "camera a: left the bus (1 other sensors are)", start + 21min));
    EXPECT_EQ(lines.size(), 5u) << "first what was counted, then the new one";
    EXPECT_FALSE(log.say(LogLevel::warning, "camera b: left the bus (3 other sensors are)", start + 1min));
  }
  EXPECT_EQ(lines.back(), "camera b: left the bus (3 other sensors are) (again, 1 time)") << "told at the end";
}

TEST(RepeatedLog, RemembersALimitedNumberOfCauses) {
  int lines = 0;
  RepeatedLog log(10min, [&](LogLevel, const std::string&) { ++lines; });
  for (int i = 0; i < 1000; ++i) log.say(LogLevel::info, std::string(1 + static_cast<std::size_t>(i), 'x'), hal::MonotonicTime(std::chrono::seconds(i)));
  EXPECT_EQ(lines, 1000);
}

}  // namespace
}  // namespace booth::daemon
