// The swarm back-end that lives on a device: one upload of the cloud, one recorded program, one answer a frame.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "fit/swarm/backend.hpp"
#include "fit/swarm/device/device.hpp"

namespace booth::fit::device {

/// A SwarmBackend with what measurements and tests want to know besides.
class DeviceSwarm : public SwarmBackend {
 public:
  /// Why the last call returned false.
  virtual DeviceError error() const = 0;
  virtual Device& device() = 0;
  /// Program numbers of a model, for Device::time(): with the field's build, and without.
  virtual int program(int model, bool with_field) const = 0;
  /// The field of the last frame; its pointers, and this one, are the device's.
  virtual const BrickView* field() const = 0;
  /// The model as the device sees it, with device pointers.
  virtual const EnergyView& energy(int model) const = 0;
};

/// All memory is taken, all programs are recorded here. The field is exact (CellField's takes a point about as near as the nearest), so answers differ a
/// little from the CPU's; over the same field they are the same bits. Throws std::invalid_argument for settings that this back-end cannot do
/// (more than 16 shape coefficients, 64 starts, 256 iterations), std::runtime_error with the driver's words where the device cannot be had.
std::unique_ptr<DeviceSwarm> make_device_swarm(std::unique_ptr<Device> device, std::span<const BodyModel* const> models, const PosePrior& prior,
                                               const SwarmSizes& sizes);

/// What make_device_swarm() would take of a device with many processors, found by asking one that only counts: for the memory plan of a machine whose device
/// is away. Throws std::invalid_argument as make_device_swarm() does.
DeviceBytes plan_device_swarm(std::span<const BodyModel* const> models, const PosePrior& prior, const SwarmSizes& sizes);

}  // namespace booth::fit::device
