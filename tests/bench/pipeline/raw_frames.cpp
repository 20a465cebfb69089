// The emulator's forward model before the measurement, the driver's decoder in it.
#include "tests/bench/pipeline/raw_frames.hpp"

#include <algorithm>

#include "drivers/kinect2/decoder.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/bench/decode/device_bench.hpp"

namespace booth::bench {

using namespace drivers::kinect2;

RawFrames::RawFrames(const tests::FrameMemory& memory) : images_(std::make_shared<std::vector<std::vector<std::vector<std::byte>>>>(memory.frames.size())) {
  const emulator::ForwardModel model(emulator::typical_camera(), emulator::realistic_phase_offsets());
  std::vector<float> depth(kPixels), infrared(kPixels);
  for (std::size_t c = 0; c < memory.frames.size(); ++c) {
    for (const hal::DepthFrame& frame : memory.frames[c]) {
      for (std::size_t i = 0; i < kPixels; ++i) {
        const std::size_t row = i / kWidth, column = i % kWidth;
        const auto z = static_cast<float>(frame.depth[row * kWidth + (kWidth - 1 - column)]) * static_cast<float>(1000 * memory.cameras[c].depth_scale);
        depth[i] = z;
        infrared[i] = z > 0 ? std::min(60000.0f, 4e10f / (z * z)) : 0.0f;
      }
      std::vector<std::byte> images(kFrameBytes);
      model.encode(depth, infrared, 0, 1, images);  // the depth is noisy already
      (*images_)[c].push_back(std::move(images));
    }
  }
}

tests::MemoryCamera::Decode RawFrames::decoder(std::size_t camera, bool on_device) const {
  if (on_device) {
    std::shared_ptr<DeviceDecoder> device = make_device_bench_decoder(false, emulator::realistic_phase_offsets());
    return [images = images_, device, camera](std::size_t number, std::span<std::uint16_t> depth) {
      if (!device->decode((*images)[camera][number], depth, {})) std::fill(depth.begin(), depth.end(), std::uint16_t{0});  // an empty room: it will be seen
    };
  }
  std::shared_ptr<Decoder> decoder = make_decoder(emulator::typical_camera(), emulator::realistic_phase_offsets());
  return [images = images_, decoder, camera](std::size_t number, std::span<std::uint16_t> depth) { decoder->decode((*images)[camera][number], depth, {}); };
}

std::size_t RawFrames::bytes() const {
  std::size_t sum = 0;
  for (const auto& camera : *images_) sum += camera.size() * kFrameBytes;
  return sum;
}

}  // namespace booth::bench
