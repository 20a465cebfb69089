// One opened Kinect v2: the sequences that open it, read its calibration, start and stop its streams and close it.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "drivers/kinect2/calibration_cache.hpp"
#include "drivers/kinect2/command_channel.hpp"
#include "drivers/usb/usb.hpp"

namespace booth::drivers::kinect2 {

/// Its status never said that it may stream: a reboot may help.
class NotReady : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The serial as it may appear in logs and file names; empty when it has other characters than letters and digits, or none.
std::string clean_serial(const std::string& serial);

/// The one plugged-in Kinect v2 with this serial. Throws usb::Error: no_device (not there), unsupported (at USB 2 speed, or two with the same serial).
usb::DeviceInfo find_kinect(usb::Bus& bus, const std::string& serial);

/// Not thread-safe. Every wait is bounded by seconds and ends early when `cancel` becomes true, with an exception.
class KinectDevice {
 public:
  /// Opens, optionally after a bus reset. Throws usb::Error or CommandError.
  KinectDevice(usb::Bus& bus, const std::string& serial, bool reset, const std::atomic<bool>& cancel);
  ~KinectDevice();  ///< stops and closes; the device is left suspended
  KinectDevice(const KinectDevice&) = delete;

  /// From `cache` when that knows this serial and firmware, else from the device, checked and stored. `cache` may be null.
  Calibration calibration(CalibrationCache* cache);

  /// Opens the streams; packets go to the sinks from then on. `colour` may be null: no colour. Throws NotReady, usb::Error or CommandError; stops what it
  /// began.
  void start(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour);
  /// Harmless when stopped. False when transfers did not call back in time.
  bool stop() noexcept;
  /// Tells the device to reboot; it leaves the bus, and this object is good for nothing else.
  void reboot();

 private:
  void resume();
  void suspend();
  void wait_until_ready();
  void streaming(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour);
  void nap(hal::Nanoseconds duration) const;

  const std::atomic<bool>& cancel_;
  std::string serial_;
  std::unique_ptr<usb::Device> device_;
  std::unique_ptr<CommandChannel> commands_;
  std::unique_ptr<usb::Stream> infrared_, colour_;
  std::size_t packet_bytes_ = 0;
  bool started_ = false;
};

}  // namespace booth::drivers::kinect2
