// The in-process transport: emulated Kinect v2 behind the same interface as libusb.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/emulator/faults.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/usb/usb.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::drivers::kinect2::emulator {

/// What an emulated device looks at: fills kPixels of depth (millimetres, device columns, row 0 on top) and infrared (0..65535) for an instant.
using View = std::function<void(hal::MonotonicTime at, std::span<float> depth, std::span<float> infrared)>;

struct EmulatedDeviceSettings {
  std::string serial = "000000000001";
  double rate = 30.0;       ///< frames per second
  double noise_counts = 0;  ///< standard deviation added to each phase image before coding
  std::uint64_t seed = 1;
  DepthCameraParameters camera;  ///< what the device says of its lens and what it renders with
  bool zero_phase_offsets = false;
  bool still = false;    ///< the view is asked once, and every frame is the same: cheap
  bool stepped = false;  ///< frames are sent one at a time by EmulatedBus::step() and their times are as if `rate` were kept: for tests without a clock
  usb::Speed speed = usb::Speed::super;
  std::size_t bytes_per_interval = kPacketBytes;  ///< what its descriptor reserves for the infrared stream
  int loop_frames = 0;  ///< so many frames are rendered once and then played in turn, for a machine that cannot render as fast; 0: each as it comes
  View view;
};

/// A box with emulated devices plugged in. Thread-safe; plug, unplug and faults may come at any time from any thread.
class EmulatedBus : public usb::Bus {
 public:
  /// Returns the device's number for the calls below.
  virtual int add(EmulatedDeviceSettings settings) = 0;
  virtual void unplug(int device) = 0;
  virtual void plug(int device) = 0;  ///< comes back with another address
  virtual FaultPlan& faults(int device) = 0;
  /// Lets a stepped device send one more frame.
  virtual void step(int device) = 0;
  /// Every request the device has seen, in order, one line each ("control 00 31 40 0", "command 0x22 3"); for tests.
  virtual std::vector<std::string> requests(int device) const = 0;
};

/// How long a device is away by itself; tests shorten it.
struct Absences {
  hal::Nanoseconds reboot = std::chrono::seconds(3), close = std::chrono::seconds(5);
};
std::shared_ptr<EmulatedBus> make_emulated_bus(std::shared_ptr<hal::Clock> clock, Absences absences = {});

}  // namespace booth::drivers::kinect2::emulator
