// What the parts of task `gpu` share.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "fit/swarm/device/device_swarm.hpp"
#include "fit/swarm/device/emulated_device.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/bench/support/body_cloud.hpp"

namespace booth::bench {

/// The CUDA device's swarm, or the emulated one's. Throws std::runtime_error saying why there is none.
std::unique_ptr<fit::device::DeviceSwarm> make_swarm(bool emulated, std::span<const fit::BodyModel* const> models, const fit::PosePrior& prior,
                                                     const fit::SwarmSizes& sizes);

/// Deviations as preset paper tracks with.
std::vector<float> tracking_deviation(const fit::PosePrior& prior, int dimensions);

/// Joint error against the swarm's size: follows `frames` frames of held-out motions in a folder of joint angles (docs/design/priors.md), each started from
/// the frame before's answer.
struct BudgetCurve {
  std::filesystem::path motions, svg;  ///< svg: a picture of the curve goes there; empty: none
  int clips = 12, frames = 30, seeds = 3;
};
void budget_curve(const Subject& subject, const BudgetCurve& what, const std::vector<int>& particles, bool emulated, Report& report);

}  // namespace booth::bench
