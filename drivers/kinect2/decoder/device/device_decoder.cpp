// Lays out the device's memory, and carries images in and pictures out.
#include "drivers/kinect2/decoder/device/device_decoder.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "drivers/kinect2/decoder/tables.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

using device::DecodeMemory;
using device::DecodeOrder;
using device::Words;
using gpu::DeviceError;

constexpr std::size_t kImagesBytes = device::kDecodedImages * kImageBytes;

/// Counts what a decoder takes, and takes it where there is a device.
class Taker {
 public:
  explicit Taker(device::Device* device) : device_(device) {}
  template <class T>
  T* device(std::size_t count) {
    bytes_.device += count * sizeof(T);
    T* out = nullptr;
    if (device_ != nullptr) check(gpu::allocate(*device_, count, out));
    return out;
  }
  template <class T>
  T* pinned(std::size_t count, T*& host) {
    bytes_.pinned += count * sizeof(T);
    void *h = nullptr, *d = nullptr;
    if (device_ != nullptr) check(device_->allocate_pinned(count * sizeof(T), h, d));
    host = static_cast<T*>(h);
    return static_cast<T*>(d);
  }
  const float* table(const std::vector<float>* from) {
    float* to = device<float>(kPixels);
    if (device_ != nullptr) check(device_->upload(to, from->data(), kPixels * sizeof(float)));
    return to;
  }
  void check(DeviceError e) const {
    if (e != DeviceError::none)
      throw std::runtime_error("depth decode on a device: " + std::string(to_string(e)) + (device_->problem().empty() ? "" : ": " + device_->problem()));
  }
  gpu::DeviceBytes bytes() const { return bytes_; }

 private:
  device::Device* device_;
  gpu::DeviceBytes bytes_;
};

/// What the host sees of the pinned memory.
struct HostSide {
  DecodeOrder* order = nullptr;
  Words* images = nullptr;
  std::uint16_t *depth = nullptr, *infrared = nullptr;
  float* millimetres = nullptr;
};

/// `tables` may be null where there is no device.
DecodeMemory take_memory(Taker& take, const DecoderTables* tables, bool with_millimetres, HostSide& host) {
  DecodeMemory m{};
  m.order = take.pinned(1, host.order);
  m.images = take.pinned(kImagesBytes / sizeof(Words), host.images);
  m.depth = take.pinned(kPixels, host.depth), m.infrared = take.pinned(kPixels, host.infrared);
  if (with_millimetres) m.millimetres = take.pinned(kPixels, host.millimetres);
  for (std::size_t f = 0; f < 3; ++f) {
    m.cosine[f] = take.table(tables ? &tables->cosine[f] : nullptr), m.sine[f] = take.table(tables ? &tables->sine[f] : nullptr);
    for (float** plane : {&m.length[f], &m.a[f], &m.b[f]}) *plane = take.device<float>(kPixels);
  }
  m.xu = take.table(tables ? &tables->rays.xu : nullptr), m.s = take.table(tables ? &tables->rays.s : nullptr);
  m.sum = take.device<float>(kPixels), m.range = take.device<float>(kPixels);
  if (tables) m.numbers = tables->numbers;
  return m;
}

class OnDevice final : public DeviceDecoder {
 public:
  OnDevice(std::unique_ptr<device::Device> device, const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings,
           bool with_millimetres)
      : device_(std::move(device)), name_("device " + device_->name()) {
    const DecoderTables tables = make_decoder_tables(camera, phase, settings);
    Taker take(device_.get());
    const auto hold = device_->hold();
    if (!hold) take.check(DeviceError::lost);
    const DecodeMemory m = take_memory(take, &tables, with_millimetres, host_);
    *host_.order = DecodeOrder{};
    bytes_ = take.bytes();
    const int rows = std::min(kHeight, 8 * device_->processors()), tiles = std::min(device::Tile::kTiles, 8 * device_->processors());
    const device::Step steps[]{{device::MeasurePhases(m), rows}, {device::FilterPhases(m), tiles}, {device::AcceptDepth(m), tiles}};
    take.check(device_->record(steps, program_));
  }

  const char* name() const override { return name_.c_str(); }
  std::span<const float> depth_millimetres() const override { return {host_.millimetres, host_.millimetres ? kPixels : 0}; }
  const char* problem() const override { return error_ == DeviceError::none ? "" : gpu::to_string(error_); }
  gpu::DeviceBytes device_bytes() const override { return bytes_; }
  device::Device& device() override { return *device_; }
  int program() const override { return program_; }

  bool decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) override {
    if (error_ != DeviceError::none) return false;
    const auto hold = device_->hold();
    if (!hold) {
      error_ = DeviceError::lost;
      return false;
    }
    std::memcpy(host_.images, images.data(), kImagesBytes);
    DecodeOrder& order = *host_.order;
    order.infrared = infrared.empty() ? 0 : 1;
    order.number = ++number_;
    order.done = ~number_;
    error_ = device_->run(program_);
    if (error_ == DeviceError::none && order.done != number_) error_ = DeviceError::lost;  // the driver said nothing, and nothing was done
    if (error_ != DeviceError::none) return false;
    std::memcpy(depth.data(), host_.depth, kPixels * sizeof(std::uint16_t));
    if (!infrared.empty()) std::memcpy(infrared.data(), host_.infrared, kPixels * sizeof(std::uint16_t));
    return true;
  }

 private:
  std::unique_ptr<device::Device> device_;
  const std::string name_;
  HostSide host_;
  gpu::DeviceBytes bytes_;
  int program_ = 0;
  std::uint32_t number_ = 0;
  DeviceError error_ = DeviceError::none;
};

}  // namespace

std::unique_ptr<DeviceDecoder> make_device_decoder(std::unique_ptr<device::Device> device, const DepthCameraParameters& camera, const PhaseOffsets& phase,
                                                   const DecoderSettings& settings, bool with_millimetres) {
  return std::make_unique<OnDevice>(std::move(device), camera, phase, settings, with_millimetres);
}

gpu::DeviceBytes plan_device_decoder() {
  Taker take(nullptr);
  HostSide host;
  take_memory(take, nullptr, false, host);
  return take.bytes();
}

}  // namespace booth::drivers::kinect2
