// The upper rungs of the recovery ladder: a port switched off and on, a controller bound anew, where this process is permitted to.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "drivers/usb/sysfs.hpp"
#include "hal/time.hpp"
#include "hal/usb_topology.hpp"

namespace booth::drivers::usb {

struct PowerOutcome {
  enum class Result : std::uint8_t { done, not_permitted, refused, failed } result = Result::failed;
  std::string sentence;
  explicit operator bool() const { return result == Result::done; }
};

/// Thread-safe; one thing at a time. Every path that is written to is made of checked names that the topology shows, never of the caller's text.
class PowerControl {
 public:
  /// `ours` says which devices may lose their power. `pause` waits; tests look at the tree meanwhile.
  PowerControl(std::function<bool(const hal::UsbDevice&)> ours, std::filesystem::path root = "/", std::function<void(hal::Nanoseconds)> pause = {});

  /// Two seconds without power at the port where a camera is or was. Refuses when something else is plugged in there.
  PowerOutcome reset_port(const std::string& port);
  /// Unbinds and binds the PCI function of the controller to which this port belongs or belonged. Refuses while anything but this camera and hubs hangs on
  /// it: another camera that delivers, a disk, a keyboard.
  PowerOutcome rebind_controller(const std::string& port);
  /// The same for a controller named by its PCI address; refuses when more than one device of ours hangs on it.
  PowerOutcome rebind_controller_at(const std::string& address);
  /// usbfs memory of the whole machine, MiB as digits, at most 1024; never made smaller.
  PowerOutcome raise_usbfs_memory(const std::string& mebibytes);
  /// PCI address of the controller to which this port belongs or belonged; empty where it is not known.
  std::string controller_of(const std::string& port);

 private:
  PowerOutcome rebind(const hal::UsbController& controller);
  hal::UsbTopology look();

  const std::function<bool(const hal::UsbDevice&)> ours_;
  const Sysfs sysfs_;
  const std::unique_ptr<hal::UsbTopologySource> topology_;
  const std::function<void(hal::Nanoseconds)> pause_;
  std::mutex mutex_;
  std::map<int, std::string> controllers_;  ///< by bus, as last seen: a controller that died has no buses any more
};

}  // namespace booth::drivers::usb
