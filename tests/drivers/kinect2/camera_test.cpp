// The camera on emulated devices: it streams, it survives what sensors do, and nobody else's camera notices.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/kinect_camera.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;
using emulator::Fault;
using hal::ReadStatus;

class KinectCameraTest : public testing::Test {
 protected:
  int add(const std::string& serial) {
    return bus_->add(
        {.serial = serial, .rate = 12, .camera = emulator::typical_camera(), .view = [](hal::MonotonicTime, std::span<float> depth, std::span<float> infrared) {
           std::fill(depth.begin(), depth.end(), 2000.0f);
           std::fill(infrared.begin(), infrared.end(), 5000.0f);
         }});
  }
  std::unique_ptr<hal::DepthCamera> camera(const std::string& serial) {
    return make_kinect_camera({.bus = bus_, .clock = clock_, .gate = std::make_shared<ResetGate>(10ms)}, {.serial = serial, .name = "front"});
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
        std::this_thread::sleep_for(50ms);
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
  std::shared_ptr<emulator::EmulatedBus> bus_ = emulator::make_emulated_bus(clock_);
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
  std::uint64_t sequence = 0;
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(front->read(frame, 2s), ReadStatus::frame);
    EXPECT_NEAR(frame.depth[kPixels / 2 + 100], 2000, 3);
    EXPECT_NEAR(frame.infrared[kPixels / 2 + 100], 5000, 30);
    EXPECT_GT(frame.captured, last);
    EXPECT_LE(frame.captured, frame.received);
    EXPECT_GT(frame.sequence, sequence);
    last = frame.captured;
    sequence = frame.sequence;
  }
  front->stop();
  EXPECT_EQ(front->read(frame, 10ms), ReadStatus::ended);
  front->start();
  EXPECT_EQ(front->read(frame, 2s), ReadStatus::frame);
}

TEST_F(KinectCameraTest, OpensAndStartsInTheRightOrder) {
  const int device = add("111");
  const auto front = camera("111");
  front->start();
  hal::DepthFrame frame;
  ASSERT_EQ(front->read(frame, 2s), ReadStatus::frame);
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
  EXPECT_GE(frames_within(*front, 3s, 3), 3);
  bus_->unplug(device);
  EXPECT_LE(frames_within(*front, 500ms), 1);
  EXPECT_NE(front->last_error().find("111"), std::string::npos);
  bus_->plug(device);
  EXPECT_GE(frames_within(*front, 5s, 3), 3);
}

TEST_F(KinectCameraTest, SurvivesAnUnplugAtEveryRequest) {
  const int device = add("111");
  const auto front = camera("111");
  for (int step = 0; step < 24; ++step) {
    bus_->faults(device).inject(Fault::unplug_on_request, 1, step);
    (void)frames_within(*front, 1500ms, 2);
    front->stop();
    bus_->faults(device).clear();
    bus_->plug(device);
    ASSERT_GE(frames_within(*front, 8s, 2), 2) << "after an unplug at request " << step;
  }
}

class KinectCameraFault : public KinectCameraTest, public testing::WithParamInterface<Fault> {};

TEST_P(KinectCameraFault, CostsFramesAndNothingElse) {
  const int device = add("111");
  const auto front = camera("111");
  ASSERT_GE(frames_within(*front, 3s, 2), 2);
  bus_->faults(device).inject(GetParam(), 3);
  (void)frames_within(*front, 700ms);
  front->stop();  // commands see their faults at the next start
  EXPECT_GE(frames_within(*front, 15s, 5), 5) << front->last_error();
}

INSTANTIATE_TEST_SUITE_P(Faults, KinectCameraFault,
                         testing::Values(Fault::packet_lost, Fault::packet_error, Fault::packet_truncated, Fault::last_packet_lost, Fault::empty_packets,
                                         Fault::footer_length, Fault::footer_index_ten, Fault::footer_index_huge, Fault::image_missing, Fault::sequence_jump,
                                         Fault::sequence_repeat, Fault::time_jump, Fault::stream_stalls, Fault::command_timeout, Fault::wrong_transaction,
                                         Fault::premature_completion, Fault::short_data, Fault::refused, Fault::never_ready, Fault::alternate_refused,
                                         Fault::vanish_after_close));

TEST_F(KinectCameraTest, RefusesACalibrationThatCannotBe) {
  for (const Fault fault : {Fault::nan_intrinsics, Fault::huge_intrinsics, Fault::short_phase_tables}) {
    const int device = add("22" + std::to_string(static_cast<int>(fault)));
    bus_->faults(device).inject(fault, 10);
    EXPECT_THROW((void)camera("22" + std::to_string(static_cast<int>(fault))), std::runtime_error);
  }
}

TEST_F(KinectCameraTest, RefusesTwoDevicesWithOneSerial) {
  add("111");
  add("111");
  EXPECT_THROW((void)camera("111"), std::runtime_error);
}

TEST_F(KinectCameraTest, OneDyingDeviceDoesNotHoldUpTheOther) {
  const int bad = add("111");
  add("222");
  const auto dying = camera("111"), well = camera("222");
  std::thread trouble([&] {
    for (int i = 0; i < 3; ++i) {
      (void)frames_within(*dying, 700ms);
      bus_->unplug(bad);
      (void)frames_within(*dying, 300ms);
      bus_->plug(bad);
    }
  });
  const int frames = frames_within(*well, 3s);
  trouble.join();
  EXPECT_EQ(well->counters().restarts, 0u);
  EXPECT_GE(frames, 10);
}

}  // namespace
}  // namespace booth::drivers::kinect2
