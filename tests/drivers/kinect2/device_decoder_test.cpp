// The decode's kernels, emulated: the CPU's bits, whatever the order of threads; and the CPU in their place when the device fails, within the frame.
#include "drivers/kinect2/decoder/device/device_decoder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <thread>

#include "drivers/kinect2/decoder/device/emulated_device.hpp"
#include "drivers/kinect2/decoder/guarded_decoder.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;
using gpu::DeviceError;
using gpu::Faults;
using gpu::Order;

const DepthCameraParameters kCamera = emulator::typical_camera();
const PhaseOffsets& phases() {
  static const PhaseOffsets all = emulator::realistic_phase_offsets();
  return all;
}

struct Picture {
  std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kPixels), infrared = std::vector<std::uint16_t>(kPixels);
  std::vector<float> millimetres = std::vector<float>(kPixels);
};

/// A ball before a wall, a hole, and to the right nothing but edges and weak signals.
std::vector<std::byte> scene() {
  std::vector<float> depth(kPixels, 3500), infrared(kPixels, 3000);
  std::mt19937_64 random(17);
  std::uniform_real_distribution<float> far(400, 9000), bright(std::log(10.0f), std::log(40000.0f));
  for (int r = 0; r < kHeight; ++r)
    for (int c = 0; c < kWidth; ++c) {
      const auto i = static_cast<std::size_t>(r * kWidth + c);
      const float x = static_cast<float>(c - 200) / 80, y = static_cast<float>(r - 200) / 80, q = x * x + y * y;
      if (q < 1) depth[i] = 1800 - 400 * std::sqrt(1 - q), infrared[i] = 8000;
      if (r < 40 && c < 60) depth[i] = 0, infrared[i] = 0;
      if (c > 330) depth[i] = r % 4 == 0 && c % 4 == 0 ? far(random) : depth[i - 1], infrared[i] = std::exp(bright(random));
    }
  std::vector<std::byte> images(kFrameBytes);
  emulator::ForwardModel(kCamera, phases()).encode(depth, infrared, 5, 5, images);
  return images;
}
std::vector<std::byte> garbage() {
  std::mt19937_64 random(3);
  std::vector<std::byte> images(kFrameBytes);
  for (auto& b : images) b = static_cast<std::byte>(random());
  return images;
}
std::vector<std::byte> saturated() {
  auto images = scene();
  std::mt19937_64 random(4);
  for (int k = 0; k < 4000; ++k) {  // a whole group of eight codes begins with 1024
    std::byte* group = images.data() + random() % (9 * kImageBytes / 11) * 11;
    group[0] = std::byte{0}, group[1] = (group[1] & std::byte{0xF8}) | std::byte{4};
  }
  return images;
}

Picture on_cpu(const std::vector<std::byte>& images, const DecoderSettings& settings, Kernel kernel) {
  Picture out;
  const auto decoder = make_decoder(kCamera, phases(), settings, kernel);
  decoder->decode(images, out.depth, out.infrared);
  const auto mm = decoder->depth_millimetres();
  out.millimetres.assign(mm.begin(), mm.end());
  return out;
}
Picture on_device(const std::vector<std::byte>& images, const DecoderSettings& settings, int processors = 8, Order order = Order::forwards) {
  Picture out;
  Faults faults;
  faults.order = order;
  const auto decoder = make_device_decoder(device::make_emulated_device(faults, processors), kCamera, phases(), settings, true);
  EXPECT_TRUE(decoder->decode(images, out.depth, out.infrared));
  const auto mm = decoder->depth_millimetres();
  out.millimetres.assign(mm.begin(), mm.end());
  return out;
}
int different(const Picture& a, const Picture& b) {
  int n = 0;
  for (std::size_t i = 0; i < kPixels; ++i) n += a.depth[i] != b.depth[i] || a.infrared[i] != b.infrared[i] || a.millimetres[i] != b.millimetres[i];
  return n;
}

const std::vector<DecoderSettings> kSettings{{}, {.parity = true}, {.bilateral_filter = false}, {.edge_filter = false}};

TEST(DeviceDecoder, GivesTheBitsOfTheBaselineKernel) {
#if !defined(__x86_64__)
  GTEST_SKIP() << "skipped: this processor's own kernel fuses multiply-adds";
#endif
  for (const auto& images : {scene(), garbage(), saturated()})
    for (const DecoderSettings& s : kSettings) EXPECT_EQ(different(on_device(images, s), on_cpu(images, s, Kernel::baseline)), 0);
}

// The bounds of docs/reference/kinect2.md, as every kernel of the CPU has them.
TEST(DeviceDecoder, AgreesWithTheReference) {
  for (const DecoderSettings& s : kSettings) {
    const auto images = scene();
    const Picture mine = on_device(images, s), right = on_cpu(images, s, Kernel::reference);
    int disagree = 0, infrared = 0;
    float apart = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
      disagree += (right.millimetres[i] > 0) != (mine.millimetres[i] > 0);
      if (right.millimetres[i] > 0 && mine.millimetres[i] > 0) apart = std::max(apart, std::abs(right.millimetres[i] - mine.millimetres[i]));
      infrared += std::abs(right.infrared[i] - mine.infrared[i]) > 1;
    }
    EXPECT_LE(disagree, 20);
    EXPECT_LE(apart, 0.01f);
    EXPECT_EQ(infrared, 0);
  }
}

// A missing barrier, or a block that reads what another one writes, shows as a difference between the two orders.
TEST(DeviceDecoder, DoesNotDependOnTheOrderOfThreadsAndBlocksNorOnTheirNumber) {
  const auto images = scene();
  const Picture one = on_device(images, {});
  EXPECT_EQ(different(one, on_device(images, {}, 8, Order::backwards)), 0);
  EXPECT_EQ(different(one, on_device(images, {}, 132)), 0);
  EXPECT_EQ(different(one, on_device(images, {}, 1, Order::backwards)), 0);
}

TEST(DeviceDecoder, RemembersNothingOfTheFrameBeforeAndAllocatesNothing) {
  Faults faults;
  const auto decoder = make_device_decoder(device::make_emulated_device(faults), kCamera, phases(), {});
  const auto first = scene(), second = garbage();
  Picture a, b;
  ASSERT_TRUE(decoder->decode(first, a.depth, a.infrared));
  const tests::AllocationCount allocations;
  ASSERT_TRUE(decoder->decode(second, b.depth, {}));
  ASSERT_TRUE(decoder->decode(first, b.depth, b.infrared));
  const auto allocated = allocations.so_far();
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_EQ(a.infrared, b.infrared);
  EXPECT_TRUE(decoder->depth_millimetres().empty()) << "nobody asked for them";
  EXPECT_TRUE(!tests::AllocationCount::supported() || allocated == 0) << allocated;
}

TEST(DeviceDecoder, PlansWhatItTakes) {
  Faults faults;
  const auto decoder = make_device_decoder(device::make_emulated_device(faults), kCamera, phases(), {});
  EXPECT_EQ(plan_device_decoder().device, decoder->device_bytes().device);
  EXPECT_EQ(plan_device_decoder().pinned, decoder->device_bytes().pinned);
  EXPECT_GT(decoder->device_bytes().pinned, 9 * kImageBytes);
}

/// A guarded decoder whose device does what `faults` say.
struct GuardedDecoder : ::testing::Test {
  void build(const gpu::GuardSettings& guard = {1h, 1h}) {
    decoder = make_guarded_decoder(
        kCamera, phases(), {}, [this](std::string&) { return device::make_emulated_device(faults); }, guard);
  }
  /// Whether a frame's picture is the one of the kernel that decoded, whichever that was.
  bool decodes(bool by_device) {
    Picture out;
    decoder->decode(images, out.depth, out.infrared);
    if (!by_device) return out.depth == cpu.depth && out.infrared == cpu.infrared;
    const Picture right = on_device(images, {});
    return out.depth == right.depth && out.infrared == right.infrared;
  }

  Faults faults;
  const std::vector<std::byte> images = scene();
  const Picture cpu = on_cpu(images, {}, available_kernels().back());
  std::unique_ptr<Decoder> decoder;
};

TEST_F(GuardedDecoder, TheCpuDecodesTheFrameThatLosesTheDevice) {
  // The driver is reset; it hangs; the device is removed; it has no memory.
  for (const DeviceError error : {DeviceError::lost, DeviceError::late, DeviceError::absent, DeviceError::out_of_memory}) {
    faults.runs_left = -1;
    build();
    EXPECT_TRUE(decodes(true));
    EXPECT_EQ(decoder->report().name, "device emulated");
    EXPECT_EQ(decoder->report().problem, "");
    faults.error = error;
    faults.runs_left = 0;
    EXPECT_TRUE(decodes(false)) << "this very frame";
    const gpu::DeviceReport r = decoder->report();
    EXPECT_FALSE(r.used);
    EXPECT_EQ(r.losses, 1u);
    EXPECT_EQ(r.name, "cpu " + std::string(to_string(available_kernels().back())));
    EXPECT_NE(r.problem.find(to_string(error)), std::string::npos) << r.problem;
    EXPECT_TRUE(decodes(false));
  }
}

TEST_F(GuardedDecoder, TakesTheDeviceBack) {
  build({1ms, 4ms});
  faults.runs_left = 0;
  EXPECT_TRUE(decodes(false));
  faults.runs_left = -1;
  Picture out;
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!decoder->report().used && std::chrono::steady_clock::now() < limit) decoder->decode(images, out.depth, out.infrared);
  EXPECT_TRUE(decoder->report().used);
  EXPECT_EQ(decoder->report().changes, 2u);
  EXPECT_TRUE(decodes(true));
}

TEST_F(GuardedDecoder, StartsOnTheCpuWhereTheDeviceHasNoMemory) {
  faults.allocations_left = 5;
  build();
  EXPECT_TRUE(decodes(false));
  EXPECT_FALSE(decoder->report().used);
  EXPECT_EQ(decoder->report().losses, 0u);
  EXPECT_NE(decoder->report().problem.find("out of device memory"), std::string::npos) << decoder->report().problem;
}

// The swarm, or another camera, loses the device and resets it: this decoder's memory went with the reset.
TEST_F(GuardedDecoder, NoticesThatSomebodyElseResetTheDevice) {
  build();
  EXPECT_TRUE(decodes(true));
  faults.gate.lose(0);
  const auto another = device::make_emulated_device(faults);
  EXPECT_TRUE(decodes(false));
  EXPECT_EQ(decoder->report().losses, 1u);
}

TEST_F(GuardedDecoder, RefusesHalfAFrame) {
  build();
  Picture out;
  EXPECT_THROW(decoder->decode(std::span(images).first(kFrameBytes - 1), out.depth, {}), std::invalid_argument);
  EXPECT_THROW(decoder->decode(images, std::span(out.depth).first(10), {}), std::invalid_argument);
}

TEST(CudaDecoder, GivesTheEmulatedDevicesBits) {
  std::string why;
  auto cuda = device::make_cuda_device(why);
  if (!cuda) GTEST_SKIP() << "skipped: " << why;
  const auto decoder = make_device_decoder(std::move(cuda), kCamera, phases(), {}, true);
  for (const auto& images : {scene(), garbage(), saturated()}) {
    Picture out;
    ASSERT_TRUE(decoder->decode(images, out.depth, out.infrared));
    const auto mm = decoder->depth_millimetres();
    out.millimetres.assign(mm.begin(), mm.end());
    EXPECT_EQ(different(out, on_device(images, {})), 0);
  }
}

}  // namespace
}  // namespace booth::drivers::kinect2
