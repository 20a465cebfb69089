// Keeps one sensor streaming across whatever happens to it: opens it, climbs the recovery ladder, waits for it while it is away.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "drivers/kinect2/kinect_camera.hpp"
#include "drivers/kinect2/kinect_device.hpp"

namespace booth::drivers::kinect2 {

/// An attempt to stream failed. `trouble` is what the next attempt should know; nothing after a stop().
class Setback : public std::runtime_error {
 public:
  Setback(std::optional<Trouble> trouble, const std::string& sentence) : std::runtime_error(sentence), trouble_(trouble) {}
  std::optional<Trouble> trouble() const { return trouble_; }

 private:
  std::optional<Trouble> trouble_;
};

/// Not thread-safe, except for cancel().
class DeviceKeeper {
 public:
  DeviceKeeper(KinectShared shared, const KinectSettings& settings);

  /// From the sensor; where that cannot be had, as it was last stored. Throws std::runtime_error when it was never read.
  Calibration learn_calibration();
  /// Streams when it returns. `trouble`: why the last stream ended or could not begin; `good_frames`: how many came since then. Throws Setback.
  void start(std::optional<Trouble> trouble, std::uint64_t good_frames, usb::StreamSink& infrared, usb::StreamSink* colour);
  void stop() noexcept;
  /// Ends a start() that waits; later ones are not concerned.
  void cancel() { cancel_ = true; }

 private:
  void climb(Trouble trouble);
  void reboot();
  bool use_tool(Rung rung);
  void open();
  void wait_for_gate();
  bool awaited() const;
  Trouble missing();
  std::string patient(const std::string& sentence) const;
  DeviceOptions options(bool reset) const { return {.reset = reset, .patience = settings_.patience, .notes = shared_.notes}; }
  std::string name() const { return "Kinect v2 " + settings_.serial; }

  const KinectShared shared_;
  const KinectSettings& settings_;
  std::unique_ptr<KinectDevice> device_;
  RecoveryLadder ladder_;
  std::string path_;  ///< the port where the device was last
  bool reset_next_;
  std::optional<hal::MonotonicTime> back_by_;  ///< until then a missing device is rebooting, not gone
  std::optional<hal::MonotonicTime> missing_since_;
  std::atomic<bool> cancel_{false};
};

}  // namespace booth::drivers::kinect2
