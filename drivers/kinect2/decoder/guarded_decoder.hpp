// Keeps depth coming when the graphics processor that decodes it fails: the CPU decodes the very frame, and the device is tried again in the background.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "drivers/kinect2/decoder.hpp"
#include "fit/gpu/device.hpp"
#include "fit/gpu/device_report.hpp"

namespace booth::drivers::kinect2 {

namespace device {
struct Kernels;
}
/// Opens the device that a decoder is to live on; null where there is none, `why` then says it in a sentence.
using DecoderDeviceOpen = std::function<std::unique_ptr<gpu::Device<device::Kernels>>(std::string& why)>;

/// A decoder over two: the device's while it works, the CPU's fastest otherwise. What the device decodes has the bits of Kernel::baseline on x86-64; between
/// kernels depth differs by micrometres (docs/reference/kinect2.md).
/// `open`: empty for the CUDA device. Throws as make_decoder() does, and std::bad_alloc.
std::unique_ptr<Decoder> make_guarded_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings,
                                              DecoderDeviceOpen open = {}, const gpu::GuardSettings& guard = {});

/// What one takes while its device works.
gpu::DeviceBytes guarded_decoder_bytes();

}  // namespace booth::drivers::kinect2
