// The decode on a graphics processor, as part of task `decode`.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/decoder/device/device_decoder.hpp"
#include "tests/bench/decode/frames.hpp"
#include "tests/bench/harness/harness.hpp"

namespace booth::bench {

/// A decoder on the CUDA device, or on the emulated one. Throws std::runtime_error saying why there is none.
std::unique_ptr<drivers::kinect2::DeviceDecoder> make_device_bench_decoder(bool emulated, const drivers::kinect2::PhaseOffsets& phase);

/// One camera by the host's clock and the device's, kernel by kernel; four cameras side by side; each beside the CPU's fastest kernel in the same run; and
/// whether the bits are the emulated device's.
void measure_device_decode(bool emulated, const drivers::kinect2::PhaseOffsets& phase, const std::vector<PackedFrame>& frames, int repeats, Report& report);

}  // namespace booth::bench
