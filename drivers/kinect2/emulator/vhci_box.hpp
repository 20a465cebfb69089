// The kernel's transport: emulated sensors plugged into the ports of vhci_hcd, for a guest that has one.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/kinect2/emulator/descriptors.hpp"
#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "hal/clock.hpp"

namespace booth::drivers::kinect2::emulator {

/// Changes to a device's introduction; its serial is that of the device.
struct VhciDeviceSettings {
  EmulatedDeviceSettings device;
  bool high_speed = false;
  std::uint16_t bytes_per_interval = 33'792;
  /// Between two packets. A guest with one processor is busy with 2,000 transfers a second and nothing else: longer intervals leave it time, and the stream is
  /// the same but for empty packets.
  hal::Nanoseconds packet_time = std::chrono::microseconds(125);
};

/// Needs the right to write to /sys/devices/platform/vhci_hcd.0. Plugs and faults may come at any time from any thread. A device that is told to reboot comes
/// back by itself after three seconds. Fault::vanish_after_close is none of this transport's: a device does not see that it is closed.
class VhciBox {
 public:
  virtual ~VhciBox() = default;  ///< unplugs everything
  /// Returns the device's number; it is not plugged in yet.
  virtual int add(VhciDeviceSettings settings) = 0;
  /// Throws std::runtime_error where the kernel has no such controller, no port is free or the device is already plugged in.
  virtual void plug(int device) = 0;
  virtual void unplug(int device) = 0;  ///< harmless when it is not plugged in; returns when the kernel has let the port go
  virtual bool plugged(int device) const = 0;
  virtual FaultPlan& faults(int device) = 0;
  virtual std::vector<std::string> requests(int device) const = 0;
  virtual std::uint64_t packets_sent(int device) const = 0;  ///< infrared packets with data since it was plugged in
  /// Sentences on what the kernel sent that was no USB/IP; empty when all is well.
  virtual std::string error(int device) const = 0;
};

std::unique_ptr<VhciBox> make_vhci_box(std::shared_ptr<hal::Clock> clock);

}  // namespace booth::drivers::kinect2::emulator
