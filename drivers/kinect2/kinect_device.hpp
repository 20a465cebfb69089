// One opened Kinect v2: the sequences that open it, read its calibration, start and stop its streams and close it.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "drivers/kinect2/calibration_cache.hpp"
#include "drivers/kinect2/command_channel.hpp"
#include "drivers/kinect2/notes.hpp"
#include "drivers/kinect2/patience.hpp"
#include "drivers/usb/usb.hpp"

namespace booth::drivers::kinect2 {

/// Its status never said that it may stream: a reboot may help.
class NotReady : public std::runtime_error {
  using std::runtime_error::runtime_error;
};
/// Somebody called stop() meanwhile.
class Cancelled : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The serial as it may appear in logs and file names; empty when it has other characters than letters and digits, or none.
std::string clean_serial(const std::string& serial);

/// The one plugged-in Kinect v2 with this serial. Throws usb::Error: no_device (not there), unsupported (at USB 2 speed, or two with the same serial).
usb::DeviceInfo find_kinect(usb::Bus& bus, const std::string& serial);

struct DeviceOptions {
  bool reset = false;  ///< a bus reset before anything else: nearly ends hangs after an unclean exit
  Patience patience{};
  Notes notes{};
};

/// Not thread-safe. Every wait is bounded by seconds and ends early when `cancel` becomes true, with Cancelled.
class KinectDevice {
 public:
  /// Throws usb::Error, CommandError or Cancelled.
  KinectDevice(usb::Bus& bus, const std::string& serial, DeviceOptions options, const std::atomic<bool>& cancel);
  ~KinectDevice();  ///< stops and closes; the device is left suspended
  KinectDevice(const KinectDevice&) = delete;

  /// From `cache` when that knows this serial and firmware, else from the device, checked and stored. `cache` may be null.
  Calibration calibration(CalibrationCache* cache);

  /// Opens the streams; packets go to the sinks from then on. `colour` may be null: no colour. Throws NotReady, usb::Error, CommandError or Cancelled; stops
  /// what it began. A stream that flows already is stopped first.
  void start(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour);
  /// Harmless when stopped. False when transfers did not call back in time or the device did not obey: close it then.
  bool stop() noexcept;
  /// Tells the device to reboot; it leaves the bus, and this object is good for nothing else.
  void reboot();

 private:
  void open(usb::Bus& bus);
  void reset(usb::Bus& bus);
  void prepare();
  void resume();
  void suspend();
  void identify();
  void lights(int level) noexcept;
  std::uint32_t wait_until_ready();
  void streaming(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour);
  void nap(hal::Nanoseconds duration) const;
  std::string name() const;

  const std::atomic<bool>& cancel_;
  const std::string serial_;
  const DeviceOptions options_;
  std::unique_ptr<usb::Device> device_;
  std::unique_ptr<CommandChannel> commands_;
  std::unique_ptr<usb::Stream> infrared_, colour_;
  std::size_t packet_bytes_ = 0;
  std::string firmware_;  ///< empty until asked
  bool started_ = false, colour_on_ = false;
};

}  // namespace booth::drivers::kinect2
