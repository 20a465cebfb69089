// Keeps frames coming when the graphics processor fails: the CPU takes the very frame over, and the device is tried again in the background.
#pragma once

#include <memory>

#include "fit/gpu/standby.hpp"
#include "fit/swarm/backend.hpp"

namespace booth::fit {

using gpu::DeviceReport;
using gpu::GuardSettings;
using DeviceStart = gpu::StartDevice<SwarmBackend>;

/// A back-end over two: the device's while it works, the CPU's otherwise. A loss costs the frame nothing but the CPU's time: set_cloud() and minimise() never
/// return false. report() may be called from any thread, everything else from one at a time.
class GuardedSwarm : public SwarmBackend {
 public:
  virtual DeviceReport report() const = 0;
};

/// Tries to start the device once, here, so that a working one serves from the first frame on; then, while there is none, in the background.
std::unique_ptr<GuardedSwarm> make_guarded_swarm(std::unique_ptr<SwarmBackend> cpu, DeviceStart start, const GuardSettings& settings = {});

}  // namespace booth::fit
