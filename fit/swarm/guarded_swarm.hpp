// Keeps frames coming when the graphics processor fails: the CPU takes the very frame over, and the device is tried again in the background.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "fit/swarm/backend.hpp"

namespace booth::fit {

/// What became of the device; a copy, taken at one moment.
struct DeviceReport {
  bool wanted = false;                                  ///< a device was asked for
  bool used = false;                                    ///< it computes now
  std::string name;                                     ///< of the back-end that computes now
  std::string problem;                                  ///< why the device does not; empty when it does
  std::uint64_t losses = 0, attempts = 0, changes = 0;  ///< times it was lost; tries to start it; times that `used` changed
};

/// Starts a device's back-end; null where that fails, `why` then says it in a sentence. Called on a thread of its own, one call at a time. Must not throw.
using DeviceStart = std::function<std::unique_ptr<SwarmBackend>(std::string& why)>;

struct GuardSettings {
  std::chrono::milliseconds first_wait{2000}, longest_wait{300000};  ///< between tries; doubles from one to the other
};

/// A back-end over two: the device's while it works, the CPU's otherwise. A loss costs the frame nothing but the CPU's time: set_cloud() and minimise() never
/// return false. report() may be called from any thread, everything else from one at a time.
class GuardedSwarm : public SwarmBackend {
 public:
  virtual DeviceReport report() const = 0;
};

/// Tries to start the device once, here, so that a working one serves from the first frame on; then, while there is none, in the background.
std::unique_ptr<GuardedSwarm> make_guarded_swarm(std::unique_ptr<SwarmBackend> cpu, DeviceStart start, const GuardSettings& settings = {});

}  // namespace booth::fit
