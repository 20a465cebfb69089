// What the ROS 2 mirror costs a booth for each frame, beside a booth without it.
#pragma once

#include <cstdint>

#include "tests/bench/harness/harness.hpp"

namespace booth::bench {

/// Two booths in this process and a subscriber of everything in another, on the loopback interface; `turns` times 200 frames of each. Adds figures to
/// `report`; throws std::runtime_error when the other process finds no booth.
void add_mirror_cost(Report& report, std::uint32_t domain, int turns);

}  // namespace booth::bench
