// Four cameras at 30 frames/s from memory through the real pipeline to DDS: latency by stage, losses, and what happens when the processor is stolen.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/bench/pipeline/raw_frames.hpp"
#include "tests/support/memory_booth.hpp"
#include "tests/support/pause_witness.hpp"

namespace booth::bench {
namespace {

using namespace std::chrono_literals;

struct Options {
  int body = 7, threads = 2;
  std::string motion;  ///< empty: as the help says
  double seconds = 30, memory_seconds = 0, warm_up = 3;
  bool decode = false;
  std::string decoder = "cpu";
  double steal = 0;  ///< seconds
  int thieves = 0;   ///< 0: two a core
};

struct Latency {
  std::vector<double> from_exposure, from_arrival;  ///< ms
};

double quantile(std::vector<double> v, double p) {
  if (v.empty()) return 0;
  const auto at = v.begin() + static_cast<std::ptrdiff_t>(std::min<double>(static_cast<double>(v.size() - 1), p * static_cast<double>(v.size())));
  std::nth_element(v.begin(), at, v.end());
  return *at;
}

Latency latency_of(const std::vector<tests::FrameNote>& notes, std::size_t from, std::size_t to) {
  Latency out;
  for (std::size_t i = from; i < to; ++i) {
    out.from_exposure.push_back(1e-6 * static_cast<double>(notes[i].published_ns - notes[i].captured_ns));
    out.from_arrival.push_back(1e-6 * static_cast<double>(notes[i].published_ns - notes[i].arrived_ns));
  }
  return out;
}

void add_quantiles(Report& report, const std::string& name, const std::vector<double>& v, double copy_ms) {
  for (const double p : {0.5, 0.95, 0.99, 1.0})
    report.add({fmt::format("{}, {}", name, p < 1 ? fmt::format("{:g} %", 100 * p) : "most"), "ms", quantile(v, p), "copy of the group's images", copy_ms});
}

/// Busy loops beside the pipeline, at its own priority.
class Thieves {
 public:
  explicit Thieves(int count) {
    for (int i = 0; i < count; ++i)
      threads_.emplace_back([this] {
        while (!stop_.load(std::memory_order_relaxed)) {
        }
      });
  }
  ~Thieves() {
    stop_ = true;
    for (auto& t : threads_) t.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

/// Tells groups that were dropped because the machine stood still from those that the fit took too long for.
class DropWitness {
 public:
  explicit DropWitness(const daemon::Pipeline& pipeline)
      : pipeline_(pipeline), seen_(dropped()), witness_(1ms, 15ms, [this](auto now, bool paused) { look(now, paused); }) {}
  std::uint64_t beside_pauses() const { return beside_; }
  const tests::PauseWitness& pauses() const { return witness_; }

 private:
  std::uint64_t dropped() const { return pipeline_.counters().groups_dropped; }
  void look(tests::PauseWitness::Clock::time_point now, bool paused) {
    if (paused) last_pause_ = now;
    const std::uint64_t total = dropped();
    if (now - last_pause_ < 200ms) beside_ += total - seen_;
    seen_ = total;
  }

  const daemon::Pipeline& pipeline_;
  std::uint64_t seen_;
  tests::PauseWitness::Clock::time_point last_pause_{};
  std::atomic<std::uint64_t> beside_{0};
  tests::PauseWitness witness_;  // last: its thread uses the others
};

/// Seconds from the theft's end to the last frame that still shows it: later than the 99 % before, half as much again.
double recovery(const std::vector<tests::FrameNote>& notes, std::size_t from, std::size_t to, double usual_ms, std::int64_t end_ns) {
  std::int64_t last = end_ns;
  for (std::size_t i = from; i < to && notes[i].published_ns < end_ns + 3'000'000'000; ++i)
    if (1e-6 * static_cast<double>(notes[i].published_ns - notes[i].captured_ns) > 1.5 * usual_ms) last = std::max(last, notes[i].published_ns);
  return 1e-9 * static_cast<double>(last - end_ns);
}

void run(Options o, const Common& common, Report& report) {
  if (common.short_form) o.seconds = std::min(o.seconds, 3.0), o.memory_seconds = 1, o.warm_up = 1;
  if (o.motion.empty()) o.motion = o.decode ? "kick" : "showcase";  // raw images are 3 MB a frame
  tests::SceneRequest scene;
  scene.body = o.body, scene.motion = o.motion, scene.seconds = o.memory_seconds;
  std::cerr << "pipeline: rendering " << o.motion << " for four cameras\n";
  const tests::FrameMemory memory = tests::render_frames(scene);
  std::unique_ptr<RawFrames> raw;
  if (o.decode) raw = std::make_unique<RawFrames>(memory);

  drivers::SystemClock clock;
  tests::MemoryBooth::Options options{.threads = o.threads, .notes = static_cast<std::size_t>((o.seconds + o.warm_up + o.steal) * 31) + 1000, .decode = {}};
  if (raw) options.decode = [&](std::size_t camera) { return raw->decoder(camera, o.decoder == "cuda"); };
  tests::MemoryBooth booth(memory, clock, std::move(options));
  const auto sleep = [](double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); };
  const auto counters = [&] { return booth.pipeline().counters(); };
  const auto camera_losses = [&] {
    std::uint64_t sum = 0;
    for (const auto& c : booth.pipeline().cameras()) sum += c.counters.dropped + c.no_slot;
    return sum;
  };
  sleep(o.warm_up);
  const auto before = counters();
  const std::uint64_t lost_before = camera_losses();
  const auto first = static_cast<std::size_t>(booth.frames());
  std::cerr << "pipeline: measuring " << o.seconds << " s\n";
  auto witness = std::make_unique<DropWitness>(booth.pipeline());
  sleep(o.seconds);
  const auto after = counters();
  const std::uint64_t lost_after = camera_losses();
  const auto last = std::min<std::size_t>(booth.frames(), booth.notes().size());
  const Latency latency = latency_of(booth.notes(), first, last);
  const double copy_ms = 1e3 * copy_seconds(memory.bytes() / memory.frames[0].size());

  report.note("motion", fmt::format("{}, {:.1f} s, again and again", o.motion, 1e-9 * static_cast<double>(memory.length.count())));
  report.note("depth decode", o.decode ? "in the camera threads, " + o.decoder : std::string("no"));
  report.note("threads", std::to_string(o.threads));
  report.note("measured", fmt::format("{:g} s", o.seconds));
  report.add({"groups formed", "", static_cast<double>(after.groups - before.groups)});
  report.add({"groups fitted", "", static_cast<double>(after.fitted - before.fitted)});
  report.add({"groups dropped by the fit", "", static_cast<double>(after.groups_dropped - before.groups_dropped)});
  report.add({"... within 0.2 s of a pause of the machine", "", static_cast<double>(witness->beside_pauses())});
  report.add({"pauses of the machine (a thread that only sleeps woke 15 ms late)", "", static_cast<double>(witness->pauses().pauses())});
  report.add({"... the longest", "ms", 1e3 * witness->pauses().longest()});
  witness.reset();
  report.add({"frames lost before the pipeline", "", static_cast<double>(lost_after - lost_before)});
  report.add({"skeletons that a DDS reader took", "", static_cast<double>(booth.heard())});
  report.add({"rate", "1/s", static_cast<double>(after.fitted - before.fitted) / o.seconds, "of the cameras", 30});
  add_quantiles(report, "from the middle of the exposures to DDS", latency.from_exposure, copy_ms);
  add_quantiles(report, "from the group's last frame to DDS", latency.from_arrival, copy_ms);
  for (int s = 0; s < daemon::kStages; ++s) {
    const auto summary = booth.pipeline().stage(static_cast<daemon::Stage>(s));
    const std::string name = std::string("stage ") + daemon::kStageNames[static_cast<std::size_t>(s)];
    for (const auto& [what, value] : {std::pair{"50 %", summary.p50_ms}, {"95 %", summary.p95_ms}, {"99 %", summary.p99_ms}, {"most", summary.max_ms}})
      report.add({name + ", " + what, "ms", value, "copy of the group's images", copy_ms});
  }
  if (o.steal <= 0) return;

  const int thieves = o.thieves > 0 ? o.thieves : 2 * static_cast<int>(std::thread::hardware_concurrency());
  std::cerr << "pipeline: " << thieves << " busy loops for " << o.steal << " s\n";
  const auto theft_first = static_cast<std::size_t>(booth.frames());
  {
    const Thieves busy(thieves);
    sleep(o.steal);
  }
  const std::int64_t end_ns = clock.now().time_since_epoch().count();
  const auto theft_last = static_cast<std::size_t>(booth.frames());
  const auto stolen = counters();
  sleep(4);
  const auto final_last = std::min<std::size_t>(booth.frames(), booth.notes().size());
  const Latency during = latency_of(booth.notes(), theft_first, theft_last);
  report.add({"stolen: busy loops", "", static_cast<double>(thieves)});
  report.add({"stolen: frames fitted", "1/s", static_cast<double>(theft_last - theft_first) / o.steal, "of the cameras", 30});
  report.add({"stolen: groups dropped, counted", "", static_cast<double>(stolen.groups_dropped - after.groups_dropped)});
  add_quantiles(report, "stolen: from the middle of the exposures to DDS", during.from_exposure, copy_ms);
  report.add({"stolen: recovery after the end", "s", recovery(booth.notes(), theft_first, final_last, quantile(latency.from_exposure, 0.99), end_ns)});
}

const Registration kTask(
    {"pipeline", "Four cameras at 30 frames/s from memory through the live pipeline to DDS: latency by stage, losses, and a stolen processor",
     [](CLI::App& app) -> Run {
       auto o = std::make_shared<Options>();
       app.add_option("--seconds", o->seconds, "How long to measure; 600 is the official length")->check(CLI::Range(1.0, 36000.0))->capture_default_str();
       app.add_option("--decoder", o->decoder, "What decodes with --decode: cpu, or cuda for a CUDA device")
           ->check(CLI::IsMember({"cpu", "cuda"}))
           ->capture_default_str();
       app.add_flag("--decode", o->decode, "The cameras deliver raw phase images, decoded in their threads");
       app.add_option("--steal", o->steal, "Afterwards, busy loops beside it for so many seconds")->check(CLI::Range(0.0, 600.0))->capture_default_str();
       app.add_option("--thieves", o->thieves, "How many busy loops; 0: two for each core")->check(CLI::Range(0, 64))->capture_default_str();
       app.add_option("--threads", o->threads, "Workers of cloud and fit")->check(CLI::Range(1, 64))->capture_default_str();
       app.add_option("--body", o->body, "Set-aside body, 1 to 90")->check(CLI::Range(1, 90))->capture_default_str();
       app.add_option("--motion", o->motion, "A motion by name, or a file that ends in .npy, .amc or .bvh (showcase; with --decode kick)");
       return [o](const Common& common, Report& report) { run(*o, common, report); };
     }});

}  // namespace
}  // namespace booth::bench
