// Two decoders, and which of them a frame goes to.
#include "drivers/kinect2/decoder/guarded_decoder.hpp"

#include <exception>
#include <utility>

#include "drivers/kinect2/decoder/device/device_decoder.hpp"
#include "fit/gpu/standby.hpp"

namespace booth::drivers::kinect2 {
namespace {

class Guarded final : public Decoder {
 public:
  Guarded(std::unique_ptr<Decoder> cpu, gpu::StartDevice<DeviceDecoder> start, const gpu::GuardSettings& guard)
      : cpu_(std::move(cpu)), standby_("cpu " + std::string(to_string(cpu_->kernel())), std::move(start), guard) {}

  /// Of the substitute.
  Kernel kernel() const override { return cpu_->kernel(); }
  std::span<const float> depth_millimetres() const override {
    return standby_.current() != nullptr ? standby_.current()->depth_millimetres() : cpu_->depth_millimetres();
  }
  std::size_t memory_bytes() const override { return cpu_->memory_bytes(); }
  gpu::DeviceReport report() const override { return standby_.report(); }

  void decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) override {
    if (DeviceDecoder* device = standby_.take()) {
      check_decoder_sizes(images, depth, infrared);
      if (device->decode(images, depth, infrared)) return;
      standby_.lose(device->problem());
    }
    cpu_->decode(images, depth, infrared);
  }

 private:
  std::unique_ptr<Decoder> cpu_;
  gpu::Standby<DeviceDecoder> standby_;
};

}  // namespace

std::unique_ptr<Decoder> make_guarded_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings,
                                              DecoderDeviceOpen open, const gpu::GuardSettings& guard) {
  if (!open) open = device::make_cuda_device;
  return std::make_unique<Guarded>(
      make_decoder(camera, phase, settings),
      [camera, phase, settings, open = std::move(open)](std::string& why) -> std::unique_ptr<DeviceDecoder> {
        try {
          if (auto found = open(why)) return make_device_decoder(std::move(found), camera, phase, settings);
        } catch (const std::exception& e) {
          why = e.what();
        }
        return nullptr;
      },
      guard);
}

gpu::DeviceBytes guarded_decoder_bytes() { return plan_device_decoder(); }

}  // namespace booth::drivers::kinect2
