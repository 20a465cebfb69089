// What to try next when a camera does not deliver: gentle things first, and each only once per trouble.
#pragma once

#include <cstdint>
#include <mutex>
#include <string_view>

#include "hal/time.hpp"

namespace booth::drivers::kinect2 {

/// Steps two to six of the ladder; the first, one repeated command, is the command channel's own.
enum class Rung : std::uint8_t {
  restart_stream,     ///< stop and start the stream of the open device
  reopen,             ///< close, open again with a bus reset
  reboot,             ///< tell the device to reboot; it is away for about three seconds
  reset_port,         ///< power-cycle the port, where the hub can and the installation permits it
  rebind_controller,  ///< unbind and bind the PCI function, where permitted
  ask_for_help,       ///< nothing is left but a hand on the plug: go on with `reopen` and say so
};
std::string_view to_string(Rung rung);

enum class Trouble : std::uint8_t {
  stalled,    ///< it streams, but no complete frame came for two seconds
  vanished,   ///< it left the bus
  absent,     ///< it left the bus and has not come back for longer than any reboot takes
  failed,     ///< a command failed or the stream could not be opened
  not_ready,  ///< its status never said that it may stream
};

/// Not thread-safe; a pure table with a memory of how far it has climbed.
class RecoveryLadder {
 public:
  /// The rung to take now. A device that vanished starts again at `reopen`: what was tried on it before says nothing about the one that comes back. For one
  /// that stays away only its port and its controller can do something, once each.
  Rung after(Trouble trouble);
  /// A hundred good frames end the trouble.
  void delivered();
  int tried() const { return tried_; }

 private:
  int next_ = 0;
  int tried_ = 0;
  int good_ = 0;
};

/// Lets one camera at a time reset, and none sooner than a while after the last: four cameras that reset together would bring each other down. Thread-safe.
class ResetGate {
 public:
  explicit ResetGate(hal::Nanoseconds spacing = std::chrono::seconds(1)) : spacing_(spacing) {}
  /// True when the caller may reset now.
  bool enter(hal::MonotonicTime now);

 private:
  const hal::Nanoseconds spacing_;
  std::mutex mutex_;
  hal::MonotonicTime next_{hal::MonotonicTime::min()};
};

}  // namespace booth::drivers::kinect2
