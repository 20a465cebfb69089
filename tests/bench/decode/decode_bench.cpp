// How long a frame of the Kinect v2 takes to decode on one thread, with each kernel that this processor has, beside the scalar reference of the same run.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <memory>

#include "drivers/kinect2/decoder.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/bench/decode/device_bench.hpp"
#include "tests/bench/decode/frames.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::bench {
namespace {

using namespace drivers::kinect2;

struct Case {
  const char* name;
  bool worst, filters, infrared;
};
constexpr Case kCases[]{{"person, filters, infrared", false, true, true},
                        {"person, filters", false, true, false},
                        {"person, no filters, infrared", false, false, true},
                        {"worst, filters, infrared", true, true, true}};

struct Output {
  std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kPixels), infrared = std::vector<std::uint16_t>(kPixels);
};

/// Each call decodes the next of the frames.
class Candidate {
 public:
  Candidate(Kernel kernel, const Case& c, const PhaseOffsets& phase, const std::vector<PackedFrame>& frames, Output& out)
      : infrared_(c.infrared),
        frames_(frames),
        out_(out),
        decoder_(make_decoder(emulator::typical_camera(), phase, {.bilateral_filter = c.filters, .edge_filter = c.filters}, kernel)) {}
  void operator()() {
    decoder_->decode(frames_[next_++ % frames_.size()], out_.depth, infrared_ ? std::span<std::uint16_t>(out_.infrared) : std::span<std::uint16_t>());
  }
  /// The nine packed images, tables and work space, and the pictures: each once.
  std::size_t bytes_touched() const { return 9 * kImageBytes + decoder_->memory_bytes() + (infrared_ ? 4 : 2) * kPixels; }

 private:
  const bool infrared_;
  const std::vector<PackedFrame>& frames_;
  Output& out_;
  std::unique_ptr<Decoder> decoder_;
  std::size_t next_ = 0;
};

double valid_share(const Output& out) {
  std::size_t n = 0;
  for (const auto d : out.depth) n += d > 0;
  return static_cast<double>(n) / static_cast<double>(kPixels);
}

void measure(const Case& c, const std::vector<PackedFrame>& frames, const PhaseOffsets& phase, int repeats, Report& report) {
  Output out;
  const auto kernels = available_kernels();
  std::vector<std::shared_ptr<Candidate>> candidates;
  std::vector<std::function<void()>> calls;
  for (const Kernel kernel : kernels) {
    candidates.push_back(std::make_shared<Candidate>(kernel, c, phase, frames, out));
    calls.emplace_back([p = candidates.back()] { (*p)(); });
  }
  const auto seconds = median_thread_seconds_in_turns(repeats, calls);
  for (std::size_t k = 0; k < kernels.size(); ++k) {
    const std::string name = fmt::format("{}: {}", to_string(kernels[k]), c.name);
    if (kernels[k] == Kernel::reference) {
      report.add({name, "ms/frame", 1e3 * seconds[k]});
      report.add({fmt::format("{}: pixels with depth", c.name), "ratio", valid_share(out)});
    } else {
      report.add({name, "ms/frame", 1e3 * seconds[k], "scalar reference", 1e3 * seconds[0]});
      const std::size_t bytes = candidates[k]->bytes_touched();
      report.add({name + ", memory floor", "ms/frame", 1e3 * seconds[k], fmt::format("copy of {:.1f} MB", 1e-6 * static_cast<double>(bytes)),
                  1e3 * copy_seconds(bytes)});
    }
    const tests::AllocationCount count;
    for (std::size_t i = 0; i < frames.size(); ++i) calls[k]();
    const auto allocations = static_cast<double>(count.so_far());
    if (tests::AllocationCount::supported())
      report.add({fmt::format("{}: {}, allocations", to_string(kernels[k]), c.name), "1/frame", allocations / static_cast<double>(frames.size())});
  }
}

Run make(CLI::App& options) {
  auto repeats = std::make_shared<int>(40);
  options.add_option("--repeats", *repeats, "Frames for each kernel and case")->check(CLI::Range(1, 10000))->capture_default_str();
  auto backend = std::make_shared<std::string>("cpu");
  options.add_option("--backend", *backend, "cpu: its kernels; cuda: the decode on a CUDA device beside the CPU's; emulated: the same on the host, slowly")
      ->check(CLI::IsMember({"cpu", "cuda", "emulated"}))
      ->capture_default_str();
  return [repeats, backend](const Common& common, Report& report) {
    const int count = common.short_form ? 1 : 8;
    const auto phase = emulator::realistic_phase_offsets();
    const auto person = person_frames(phase, count), worst = worst_frames(phase, count);
    if (*backend != "cpu") {
      measure_device_decode(*backend == "emulated", phase, person, common.short_form ? 1 : *repeats, report);
      return;
    }
    report.note("clock", "processor time of the one thread; median");
    report.note("fastest_kernel", std::string(to_string(available_kernels().back())));
    for (const Case& c : kCases) measure(c, c.worst ? worst : person, phase, common.short_form ? 1 : *repeats, report);
  };
}

const Registration registration({"decode", "Kinect v2 depth decoder: milliseconds per frame of each kernel, against the scalar reference", make});

}  // namespace
}  // namespace booth::bench
