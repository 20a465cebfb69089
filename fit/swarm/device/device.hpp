// The swarm's kernels as one set, and the device that they run on.
#pragma once

#include <variant>

#include "fit/gpu/device.hpp"
#include "fit/swarm/device/field_kernels.hpp"
#include "fit/swarm/device/swarm_kernels.hpp"

namespace booth::fit::device {

using gpu::allocate;
using gpu::DeviceError;

/// A swarm small enough takes fewer particles a block, so that all processors have something to do.
using Iterate4 = Iterate<4, 4>;
using Iterate16 = Iterate<16, 8>;
/// Every kernel there is.
struct Kernels {
  using Any = std::variant<TakeCloud, CountPoints, StartRows, SortPoints, DescribeBricks, DescribeCells, TakeFrame, Iterate4, Iterate16>;
};
using Device = gpu::Device<Kernels>;
using Step = gpu::Step<Kernels>;

}  // namespace booth::fit::device
