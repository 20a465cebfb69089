// The camera on emulated devices: it streams, it survives what sensors do, and nobody else's camera notices.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/kinect_camera.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;
using emulator::Fault;
using hal::ReadStatus;

/// Real waits would make these tests last for minutes; what is waited for is the same.
#ifdef BOOTHD_SANITIZED
constexpr auto kStall = 4s;  // a frame takes long there
#else
constexpr auto kStall = 400ms;
#endif
constexpr Patience kShort{.open_again = 5ms, .ready = 100ms, .ready_poll = 10ms, .renumbered = 20ms, .stall = kStall, .absence = 300ms};

class KinectCameraTest : public testing::Test {
 protected:
  int add(const std::string& serial) {
    return bus_->add({.serial = serial,
                      .rate = 25,
                      .camera = emulator::typical_camera(),
                      .still = true,
                      .view = [](hal::MonotonicTime, std::span<float> depth, std::span<float> infrared) {
                        std::fill(depth.begin(), depth.end(), 2000.0f);
                        std::fill(infrared.begin(), infrared.end(), 5000.0f);
                      }});
  }
  std::unique_ptr<hal::DepthCamera> camera(const std::string& serial) {
    return make_kinect_camera({.bus = bus_, .clock = clock_, .gate = std::make_shared<ResetGate>(10ms)},
                              {.serial = serial, .name = "front", .colour = colour_, .patience = kShort});
  }
  /// Reads as a camera's thread does: starts anew, after a moment, whenever the camera says that it is lost.
  static int frames_within(hal::DepthCamera& camera, std::chrono::milliseconds span, int enough = 1'000'000) {
    hal::DepthFrame frame;
    int frames = 0;
    const auto end = std::chrono::steady_clock::now() + span;
    bool running = false;
    while (std::chrono::steady_clock::now() < end && frames < enough) {
      try {
        if (!running) camera.start();
        running = true;
      } catch (const std::runtime_error&) {
        std::this_thread::sleep_for(10ms);
        continue;
      }
      const auto status = camera.read(frame, 50ms);
      frames += status == ReadStatus::frame;
      if (status == ReadStatus::lost) {
        camera.stop();
        running = false;
      }
    }
    return frames;
  }
  std::shared_ptr<hal::Clock> clock_ = std::make_shared<SystemClock>();
  std::shared_ptr<emulator::EmulatedBus> bus_ = emulator::make_emulated_bus(clock_, {.reboot = 200ms, .close = 500ms});
  bool colour_ = false;
};

TEST_F(KinectCameraTest, StreamsWhatTheDeviceSees) {
  add("111");
  const auto front = camera("111");
  EXPECT_EQ(front->description().serial, "111");
  EXPECT_NEAR(front->description().intrinsics.cx, 511.5 - 260.9255, 1e-3);
  front->start();
  hal::DepthFrame frame;
  frame.infrared.resize(kPixels);
  hal::MonotonicTime last{};
  std::optional<std::uint64_t> sequence;
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(front->read(frame, 20s), ReadStatus::frame);
    EXPECT_NEAR(frame.depth[kPixels / 2 + 100], 2000, 3);
    EXPECT_NEAR(frame.infrared[kPixels / 2 + 100], 5000, 30);
    EXPECT_GT(frame.captured, last);
    EXPECT_LE(frame.captured, frame.received);
    if (sequence) {
      EXPECT_GT(frame.sequence, *sequence);
    }
    last = frame.captured;
    sequence = frame.sequence;
  }
  front->stop();
  EXPECT_EQ(front->read(frame, 10ms), ReadStatus::ended);
  front->start();
  EXPECT_EQ(front->read(frame, 20s), ReadStatus::frame);
}

TEST_F(KinectCameraTest, OpensAndStartsInTheRightOrder) {
  const int device = add("111");
  const auto front = camera("111");
  front->start();
  hal::DepthFrame frame;
  ASSERT_EQ(front->read(frame, 20s), ReadStatus::frame);
  const auto requests = bus_->requests(device);
  const auto at = [&](const std::string& line) { return std::find(requests.begin(), requests.end(), line) - requests.begin(); };
  EXPECT_LT(at("claim 0"), at("claim 1"));
  EXPECT_LT(at("claim 1"), at("alternate 1 0"));
  EXPECT_LT(at("alternate 1 0"), at("control 0 3 48 0"));
  EXPECT_LT(at("control 0 3 48 0"), at("control 1 3 0 768")) << "suspended before it is started";
  EXPECT_LT(at("control 1 3 0 0"), at("alternate 1 1"));
  EXPECT_LT(at("alternate 1 1"), at("stream"));
}

TEST_F(KinectCameraTest, ComesBackAfterAnUnplugWhileStreaming) {
  const int device = add("111");
  const auto front = camera("111");
  EXPECT_GE(frames_within(*front, 20s, 3), 3);
  bus_->unplug(device);
  int late = 0;  // what was under way
  for (int i = 0; i < 200 && front->last_error().empty(); ++i) late += frames_within(*front, 100ms);
  EXPECT_LE(late, 2);
  EXPECT_NE(front->last_error().find("111"), std::string::npos);
  bus_->plug(device);
  EXPECT_GE(frames_within(*front, 20s, 3), 3);
}

TEST_F(KinectCameraTest, SurvivesAnUnplugAtEveryStepOfOpenStartAndStop) {
  colour_ = true;
  const int device = add("111");
  const auto front = camera("111");
  // How many requests one life has: a reset and open, a start, a stop.
  const auto before = bus_->requests(device).size();
  ASSERT_GE(frames_within(*front, 20s, 1), 1);
  front->stop();
  const auto steps = static_cast<int>(bus_->requests(device).size() - before);
  EXPECT_GT(steps, 30);
  for (int step = 0; step < steps; ++step) {
    bus_->unplug(device);  // so that the next life begins with opening
    (void)frames_within(*front, 30ms);
    bus_->plug(device);
    bus_->faults(device).inject(Fault::unplug_on_request, 1, step);
    (void)frames_within(*front, 150ms, 1);
    front->stop();
    bus_->faults(device).clear();
    bus_->plug(device);
    ASSERT_GE(frames_within(*front, 20s, 1), 1) << "after an unplug at request " << step << ": " << front->last_error();
    front->stop();
  }
}

TEST_F(KinectCameraTest, AStartThatFailedIsNotTakenForOneThatStreams) {
  const int device = add("111");
  const auto front = camera("111");
  bus_->faults(device).inject(Fault::alternate_refused);
  EXPECT_THROW(front->start(), std::runtime_error);
  EXPECT_NE(front->last_error().find("bandwidth"), std::string::npos);
  hal::DepthFrame frame;
  EXPECT_EQ(front->read(frame, 1ms), ReadStatus::ended);
  front->start();
  EXPECT_EQ(front->read(frame, 20s), ReadStatus::frame);
  EXPECT_EQ(front->last_error(), "");
}

TEST_F(KinectCameraTest, ADeviceThatStallsIsStartedAnew) {
  const int device = add("111");
  const auto front = camera("111");
  for (int round = 0; round < 3; ++round) {
    bus_->faults(device).inject(Fault::stream_stalls, 1, 5);
    ASSERT_GE(frames_within(*front, 20s, 15), 15) << front->last_error();
  }
  EXPECT_GE(front->counters().restarts, 2u);
}

TEST_F(KinectCameraTest, ALongReadSaysThatTheStreamStalls) {
  const int device = add("111");
  const auto front = camera("111");
  front->start();
  bus_->faults(device).inject(Fault::stream_stalls);
  hal::DepthFrame frame;
  ReadStatus status = ReadStatus::frame;
  while (status == ReadStatus::frame) status = front->read(frame, 1h);
  EXPECT_EQ(status, ReadStatus::lost);
}

TEST_F(KinectCameraTest, ADeviceThatNeverBecomesReadyIsRebooted) {
  const int device = add("111");
  const auto front = camera("111");
  bus_->faults(device).inject(Fault::never_ready, 12);
  ASSERT_GE(frames_within(*front, 20s, 3), 3) << front->last_error();
}

TEST_F(KinectCameraTest, ADeviceThatVanishesAfterACloseIsAwaited) {
  const int device = add("111");
  const auto front = camera("111");
  ASSERT_GE(frames_within(*front, 20s, 2), 2);
  bus_->faults(device).inject(Fault::vanish_after_close);
  bus_->faults(device).inject(Fault::refused);  // a start that fails: the device is closed, and gone for half a second
  front->stop();
  ASSERT_GE(frames_within(*front, 20s, 3), 3) << front->last_error();
}

TEST_F(KinectCameraTest, APortIsResetOnlyForADeviceThatStaysAway) {
  const int device = add("111");
  int resets = 0;
  KinectShared shared{.bus = bus_, .clock = clock_, .gate = std::make_shared<ResetGate>(1ms)};
  shared.power.reset_port = [&](const std::string& path) {
    EXPECT_EQ(path, "1-1");
    ++resets;
    bus_->plug(device);
    return true;
  };
  const auto front = make_kinect_camera(shared, {.serial = "111", .name = "front", .patience = kShort});
  ASSERT_GE(frames_within(*front, 20s, 2), 2);
  bus_->unplug(device);
  (void)frames_within(*front, 150ms);
  EXPECT_EQ(resets, 0) << "it may come back by itself";
  ASSERT_GE(frames_within(*front, 20s, 2), 2) << front->last_error();
  EXPECT_EQ(resets, 1);
}

TEST_F(KinectCameraTest, StopEndsAStartThatWaits) {
  const int device = add("111");
  Patience patience = kShort;
  patience.ready = 1h;
  const auto front = make_kinect_camera({.bus = bus_, .clock = clock_}, {.serial = "111", .name = "front", .patience = patience});
  bus_->faults(device).inject(Fault::never_ready, 1'000'000);
  std::thread starting([&] { EXPECT_THROW(front->start(), std::runtime_error); });
  while (bus_->requests(device).size() < 60) std::this_thread::sleep_for(1ms);
  front->stop();
  starting.join();
  hal::DepthFrame frame;
  EXPECT_EQ(front->read(frame, 1ms), ReadStatus::ended);
}

TEST_F(KinectCameraTest, StartsFromTheCacheWithoutTheDevice) {
  std::string pattern = (std::filesystem::temp_directory_path() / "booth-camera-XXXXXX").string();
  ASSERT_NE(mkdtemp(pattern.data()), nullptr);
  const int device = add("111");
  const KinectShared shared{.bus = bus_, .clock = clock_, .cache = std::make_shared<CalibrationCache>(pattern)};
  const KinectSettings settings{.serial = "111", .name = "front", .patience = kShort};
  bus_->unplug(device);
  EXPECT_THROW((void)make_kinect_camera(shared, settings), std::runtime_error) << "never seen";
  bus_->plug(device);
  (void)make_kinect_camera(shared, settings);
  bus_->unplug(device);
  const auto front = make_kinect_camera(shared, settings);
  EXPECT_THROW(front->start(), std::runtime_error);
  bus_->plug(device);
  EXPECT_GE(frames_within(*front, 20s, 2), 2);
  std::filesystem::remove_all(pattern);
}

TEST_F(KinectCameraTest, AllocatesNothingWhileItStreams) {
  if (!tests::AllocationCount::supported()) GTEST_SKIP() << "sanitizers bring their own malloc";
  colour_ = true;
  add("111");
  const auto front = camera("111");
  front->start();
  hal::DepthFrame frame;
  frame.infrared.resize(kPixels);
  for (int i = 0; i < 3; ++i) ASSERT_EQ(front->read(frame, 20s), ReadStatus::frame);
  const tests::AllocationCount count;
  for (int i = 0; i < 10; ++i) ASSERT_EQ(front->read(frame, 20s), ReadStatus::frame);
  for (int i = 0; i < 10; ++i) (void)front->read(frame, 1ms);  // mostly in vain
  EXPECT_EQ(count.so_far(), 0u) << "of all threads: bus, parser, colour, decoder, reader";
}

class KinectCameraFault : public KinectCameraTest, public testing::WithParamInterface<Fault> {};

TEST_P(KinectCameraFault, CostsFramesAndNothingElse) {
  colour_ = true;
  const int device = add("111");
  const auto front = camera("111");
  ASSERT_GE(frames_within(*front, 20s, 2), 2);
  bus_->faults(device).inject(GetParam(), 3);
  (void)frames_within(*front, 120ms);
  front->stop();  // commands see their faults at the next start
  EXPECT_GE(frames_within(*front, 20s, 5), 5) << front->last_error();
}

// What the other faults of the streams cost is measured frame by frame in stream_fault_test.cpp.
INSTANTIATE_TEST_SUITE_P(Faults, KinectCameraFault,
                         testing::Values(Fault::packet_error, Fault::sequence_jump, Fault::sequence_wraps, Fault::time_jump, Fault::time_wraps,
                                         Fault::stream_stalls, Fault::colour_too_long, Fault::command_timeout, Fault::late_completion,
                                         Fault::reply_is_completion, Fault::wrong_transaction, Fault::premature_completion, Fault::short_data, Fault::refused,
                                         Fault::never_ready, Fault::alternate_refused, Fault::vanish_after_close));

TEST_F(KinectCameraTest, RefusesACalibrationThatCannotBe) {
  for (const Fault fault : {Fault::nan_intrinsics, Fault::zero_intrinsics, Fault::huge_intrinsics, Fault::short_phase_tables}) {
    const std::string serial = "22" + std::to_string(static_cast<int>(fault));
    const int device = add(serial);
    bus_->faults(device).inject(fault, 10);
    EXPECT_THROW((void)camera(serial), std::runtime_error);
    bus_->faults(device).clear();
    EXPECT_NO_THROW((void)camera(serial));
  }
}

TEST_F(KinectCameraTest, RefusesTwoDevicesWithOneSerial) {
  add("111");
  add("111");
  EXPECT_THROW((void)camera("111"), std::runtime_error);
}

}  // namespace
}  // namespace booth::drivers::kinect2
