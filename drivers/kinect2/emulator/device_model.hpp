// One emulated sensor, whatever carries its packets: what it answers and what it streams.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {

/// Thread-safe, except that one thread at a time draws frames.
class DeviceModel {
 public:
  explicit DeviceModel(EmulatedDeviceSettings settings);

  const EmulatedDeviceSettings& settings() const { return settings_; }
  FaultPlan& faults() { return faults_; }
  void note(const std::string& line);
  std::vector<std::string> log() const;

  /// Back to alternate setting 0, streams off, nothing queued.
  void bus_reset();
  void control(const usb::ControlRequest& request);
  void set_alternate(int alternate) { alternate_ = alternate; }
  /// A packet to the command endpoint; its answers are queued.
  void command(std::span<const std::byte> packet);
  bool take_reply(std::vector<std::byte>& out);
  bool wants_reboot() { return reboot_.exchange(false); }
  bool streams_infrared() const { return infrared_ && alternate_ == 1 && !suspended_; }
  bool streams_colour() const { return colour_ && !suspended_; }
  hal::Nanoseconds frame_period() const { return hal::from_seconds(1.0 / settings_.rate); }
  /// The ten packed images of what is seen at an instant.
  void render(hal::MonotonicTime at, std::uint64_t frame, std::span<std::byte> images);
  /// Renders the frames that are played in turn, where settings().loop_frames asks for it; else does nothing.
  void prepare_loop(hal::MonotonicTime at);
  std::uint32_t last_transaction() const { return last_transaction_; }

 private:
  std::vector<std::byte> answer(std::uint32_t code, std::span<const std::uint32_t> parameters, std::uint32_t& status);
  std::vector<std::byte> page(std::uint32_t number);

  const EmulatedDeviceSettings settings_;
  const PhaseOffsets phase_;
  const ForwardModel forward_;
  std::vector<float> depth_, brightness_;
  std::vector<std::byte> still_;  ///< the one frame of a device with a still view
  std::vector<std::vector<std::byte>> loop_;
  FaultPlan faults_;
  mutable std::mutex mutex_;
  std::vector<std::string> log_;
  std::deque<std::vector<std::byte>> replies_, late_;
  std::map<std::uint32_t, std::uint32_t> colour_settings_;
  std::atomic<int> alternate_{0};
  std::atomic<bool> infrared_{false}, colour_{false}, suspended_{false}, reboot_{false};
  std::atomic<std::uint32_t> last_transaction_{0};
};

/// Cuts a device's frames into isochronous packets, faults included. One thread.
class InfraredSource {
 public:
  explicit InfraredSource(DeviceModel& model) : model_(model), images_(kFrameBytes), wire_(kSubImageBytes) {}
  /// Makes the frame that is exposed at an instant; it may lie ahead, so that a slow host is not a late device.
  void expose(hal::MonotonicTime at);
  /// Sends the frame that was exposed last; `send` returns false when nobody listens any more.
  void send_exposed(const std::function<bool(usb::Status, std::span<const std::byte>)>& send);
  /// Both at once.
  void send_frame(hal::MonotonicTime at, const std::function<bool(usb::Status, std::span<const std::byte>)>& send);

 private:
  bool send_image(int index, std::uint32_t timestamp, const std::function<bool(usb::Status, std::span<const std::byte>)>& send);

  DeviceModel& model_;
  std::vector<std::byte> images_, wire_;
  std::uint64_t frame_ = 0;
  std::uint32_t sequence_ = 0, time_offset_ = 0;
  bool stalled_ = false;
  hal::MonotonicTime exposed_{};
};

}  // namespace booth::drivers::kinect2::emulator
