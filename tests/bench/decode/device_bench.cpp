// Host and device clocks around the decode's kernels.
#include "tests/bench/decode/device_bench.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <chrono>
#include <stdexcept>
#include <thread>

#include "drivers/kinect2/decoder/device/emulated_device.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::bench {

using namespace drivers::kinect2;

namespace {

constexpr int kCameras = 4;

struct Output {
  std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kPixels), infrared = std::vector<std::uint16_t>(kPixels);
};

/// Median of the time from the moment that four threads begin a frame each until the last has ended, ms.
template <class DecodeOne>
double four_side_by_side(int repeats, const DecodeOne& decode_one) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> times;
  std::barrier gate(kCameras + 1);
  std::vector<std::thread> threads;
  for (int c = 0; c < kCameras; ++c)
    threads.emplace_back([&, c] {
      for (int r = 0; r < repeats; ++r) {
        gate.arrive_and_wait();
        decode_one(c, r);
        gate.arrive_and_wait();
      }
    });
  for (int r = 0; r < repeats; ++r) {
    gate.arrive_and_wait();
    const auto begin = Clock::now();
    gate.arrive_and_wait();
    times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
  }
  for (auto& t : threads) t.join();
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
  return times[times.size() / 2];
}

void decode_on(DeviceDecoder& decoder, const PackedFrame& frame, Output& out) {
  if (!decoder.decode(frame, out.depth, out.infrared)) throw std::runtime_error(decoder.problem());
}

}  // namespace

std::unique_ptr<DeviceDecoder> make_device_bench_decoder(bool emulated, const PhaseOffsets& phase) {
  static gpu::Faults none;
  std::string why;
  auto device = emulated ? device::make_emulated_device(none, 132) : device::make_cuda_device(why);
  if (!device) throw std::runtime_error("skipped: " + why);
  return make_device_decoder(std::move(device), emulator::typical_camera(), phase, {});
}

void measure_device_decode(bool emulated, const PhaseOffsets& phase, const std::vector<PackedFrame>& frames, int repeats, Report& report) {
  const auto decoder = make_device_bench_decoder(emulated, phase);
  const auto cpu = make_decoder(emulator::typical_camera(), phase);
  const std::string reference = fmt::format("cpu {}", to_string(cpu->kernel()));
  report.note("device", decoder->name());
  Output out;
  std::size_t next = 0;
  const auto frame = [&]() -> const PackedFrame& { return frames[next++ % frames.size()]; };
  const auto seconds = median_seconds_in_turns(repeats, {[&] { cpu->decode(frame(), out.depth, out.infrared); }, [&] { decode_on(*decoder, frame(), out); }});
  report.add({"device: one camera, images handed over to depth (host clock)", "ms/frame", 1e3 * seconds[1], reference, 1e3 * seconds[0]});
  const auto thread_seconds =
      median_thread_seconds_in_turns(repeats, {[&] { cpu->decode(frame(), out.depth, out.infrared); }, [&] { decode_on(*decoder, frame(), out); }});
  report.add({"device: one camera, processor time of the host", "ms/frame", 1e3 * thread_seconds[1], reference, 1e3 * thread_seconds[0]});
  const char* steps[] = {"measure phases (images over the bus)", "filter phases", "accept depth (picture over the bus)"};
  for (int s = -1; s < 3; ++s) {
    double ms = 0;
    if (const auto e = decoder->device().time(decoder->program(), s, repeats, ms); e != gpu::DeviceError::none)
      throw std::runtime_error(fmt::format("{}: {}", to_string(e), decoder->device().problem()));
    report.add({s < 0 ? std::string("device: all kernels (device clock)") : fmt::format("device: step by itself: {}", steps[s]), "ms/frame", ms});
  }
  report.add({"device: bytes over the bus, and back", "MB", 1e-6 * static_cast<double>(9 * kImageBytes + 4 * kPixels)});

  std::vector<std::unique_ptr<DeviceDecoder>> on_device;
  std::vector<std::unique_ptr<Decoder>> on_cpu;
  std::vector<Output> outputs(kCameras);
  for (int c = 0; c < kCameras; ++c)
    on_device.push_back(make_device_bench_decoder(emulated, phase)), on_cpu.push_back(make_decoder(emulator::typical_camera(), phase));
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  const auto number = [&](int c, int r) { return at(c + r) % frames.size(); };
  const double theirs =
      four_side_by_side(repeats, [&](int c, int r) { on_cpu[at(c)]->decode(frames[number(c, r)], outputs[at(c)].depth, outputs[at(c)].infrared); });
  std::atomic<bool> lost{false};
  const double ours = four_side_by_side(repeats, [&](int c, int r) {
    if (!on_device[at(c)]->decode(frames[number(c, r)], outputs[at(c)].depth, outputs[at(c)].infrared)) lost = true;
  });
  if (lost) throw std::runtime_error("the device was lost");
  report.add({"device: four cameras side by side (host clock)", "ms", ours, reference + ", four threads", theirs});

  const auto emulation = make_device_bench_decoder(true, phase);
  int unlike = 0;
  Output expected;
  for (std::size_t i = 0; i < std::min<std::size_t>(frames.size(), 3); ++i) {
    decode_on(*decoder, frames[i], out), decode_on(*emulation, frames[i], expected);
    unlike += out.depth != expected.depth || out.infrared != expected.infrared;
  }
  report.add({"device: frames whose bits are not the emulated device's", "", static_cast<double>(unlike)});
}

}  // namespace booth::bench
