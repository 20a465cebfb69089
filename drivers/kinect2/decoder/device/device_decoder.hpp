// The decoder that lives on a graphics processor: packed images in, depth out, one recorded program a frame.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "drivers/kinect2/decoder.hpp"
#include "drivers/kinect2/decoder/device/device.hpp"

namespace booth::drivers::kinect2 {

/// One thread at a time.
class DeviceDecoder {
 public:
  virtual ~DeviceDecoder() = default;
  virtual const char* name() const = 0;  ///< "device cuda NVIDIA ..."
  /// As Decoder::decode(), with the bits of Kernel::baseline on x86-64. False: the device is lost, the pictures are void, and somebody else must decode this
  /// frame and those after it. Allocates nothing.
  [[nodiscard]] virtual bool decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) = 0;
  /// As Decoder's; empty unless it was asked for.
  virtual std::span<const float> depth_millimetres() const = 0;
  virtual const char* problem() const = 0;  ///< why decode() said false
  virtual gpu::DeviceBytes device_bytes() const = 0;
  virtual device::Device& device() = 0;
  virtual int program() const = 0;  ///< for Device::time()
};

/// Takes all memory and records the program. Throws std::runtime_error with the driver's words where the device cannot be had.
std::unique_ptr<DeviceDecoder> make_device_decoder(std::unique_ptr<device::Device> device, const DepthCameraParameters& camera, const PhaseOffsets& phase,
                                                   const DecoderSettings& settings, bool with_millimetres = false);

/// What that takes, without a device.
gpu::DeviceBytes plan_device_decoder();

}  // namespace booth::drivers::kinect2
