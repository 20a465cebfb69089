// Task `gpu`: the swarm on a CUDA device by its own clock, kernel by kernel and size by size, beside the CPU's and the machine's floors; and that its bits are
// right.
#include "tests/bench/gpu/gpu_bench.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>

#include "fit/swarm/device/cuda_device.hpp"

namespace booth::bench {

std::unique_ptr<fit::device::DeviceSwarm> make_swarm(bool emulated, std::span<const fit::BodyModel* const> models, const fit::PosePrior& prior,
                                                     const fit::SwarmSizes& sizes) {
  static fit::device::Faults none;
  std::string why;
  auto device = emulated ? fit::device::make_emulated_device(none, 132) : fit::device::make_cuda_device(why);
  if (!device) throw std::runtime_error("skipped: " + why);
  return fit::device::make_device_swarm(std::move(device), models, prior, sizes);
}

std::vector<float> tracking_deviation(const fit::PosePrior& prior, int dimensions) {
  std::vector<float> out(static_cast<std::size_t>(dimensions), 1.0f);
  for (int k = 0; k < fit::kDofs; ++k) out[static_cast<std::size_t>(k)] = k < 3 ? 0.1f : k < 6 ? 0.2f : static_cast<float>(prior.standard_deviation[k - 6]);
  return out;
}

namespace {

using fit::device::DeviceSwarm;

struct Options {
  std::string backend = "cuda", motions;
  bool check = false, curve = false;
  int repeats = 200, points = 60000, clips = 12, frames = 30, seeds = 3;
  double soak = 0, rate = 0;
  std::string svg;
};

struct Answer {
  std::vector<float> best, history;
  float cost = 0;
  bool operator==(const Answer& o) const { return best == o.best && history == o.history && std::memcmp(&cost, &o.cost, sizeof cost) == 0; }
};

struct Bench {
  const Options& o;
  Report& report;
  Subject subject = load_subject();
  fit::Cloud cloud = surface_cloud(subject.model, subject.beta, subject.q, o.points, 0.003f, 1);
  std::vector<float> centre{}, deviation{};
  bool emulated = o.backend == "emulated";

  Bench(const Options& options, Report& r) : o(options), report(r) {
    const int d = fit::kDofs + std::min(15, subject.model.shape_count());
    centre.assign(static_cast<std::size_t>(d), 0);
    for (int k = 0; k < fit::kDofs; ++k) centre[static_cast<std::size_t>(k)] = static_cast<float>(subject.q[k]) + (k < 3 ? 0.03f : 0.05f);
    deviation = tracking_deviation(subject.prior, d);
  }

  Answer answer(fit::SwarmBackend& swarm, std::uint64_t frame) const {
    fit::SwarmResult r;
    if (!swarm.set_cloud(cloud) || !swarm.minimise(0, centre, deviation, {1, frame}, r)) throw std::runtime_error("the device was lost");
    return {{r.best.begin(), r.best.end()}, {r.history.begin(), r.history.end()}, r.cost};
  }
  double device_ms(DeviceSwarm& swarm, int program, int step = -1) const {
    double ms = 0;
    if (const auto e = swarm.device().time(program, step, o.repeats, ms); e != fit::device::DeviceError::none)
      throw std::runtime_error(fmt::format("{}: {}", to_string(e), swarm.device().problem()));
    return ms;
  }

  /// 20 frames twice, and three of them on the emulated device: every bit.
  void check_bits(DeviceSwarm& swarm, const fit::SwarmSizes& sizes) const {
    std::uint64_t hash = 0xcbf29ce484222325u;
    std::vector<Answer> first;
    int different = 0;
    for (std::uint64_t f = 0; f < 20; ++f) {
      first.push_back(answer(swarm, f));
      for (float v : first.back().best) {
        std::uint32_t bits;
        std::memcpy(&bits, &v, sizeof bits);
        for (int b = 0; b < 4; ++b) hash = (hash ^ (bits >> (8 * b) & 255)) * 0x100000001b3u;
      }
    }
    for (std::uint64_t f = 0; f < 20; ++f) different += !(answer(swarm, f) == first[static_cast<std::size_t>(f)]);
    report.note("signature", fmt::format("{:016x}", hash));
    report.add({"frames of 20 whose second run has other bits", "", static_cast<double>(different)});
    const fit::BodyModel* model = &subject.model;
    const auto emulation = make_swarm(true, {&model, 1}, subject.prior, sizes);
    int unlike = 0;
    for (std::uint64_t f = 0; f < 3; ++f) unlike += !(answer(*emulation, f) == first[static_cast<std::size_t>(f)]);
    report.add({"frames of 3 whose bits are not the emulated device's", "", static_cast<double>(unlike)});
  }

  void paper_budget() const {
    const fit::BodyModel* model = &subject.model;
    const fit::SwarmSizes sizes{};
    const auto swarm = make_swarm(emulated, {&model, 1}, subject.prior, sizes);
    report.note("device", swarm->name());
    fit::WorkerPool pool(2);
    const auto cpu = fit::make_cpu_swarm({&model, 1}, subject.prior, sizes, pool);
    const auto seconds = median_seconds_in_turns(std::min(o.repeats, 30), {[&] { answer(*cpu, 1); }, [&] { answer(*swarm, 1); }});
    const std::string reference = fmt::format("{} x2, whole frame", cpu->name());
    report.add({"whole frame, cloud handed over to answer (host clock)", "ms", 1e3 * seconds[1], reference, 1e3 * seconds[0]});
    report.add({"field and swarm (device clock)", "ms", device_ms(*swarm, swarm->program(0, true)), reference, 1e3 * seconds[0]});
    report.add({"swarm alone (device clock)", "ms", device_ms(*swarm, swarm->program(0, false))});
    const char* steps[] = {"take cloud and frame over the bus, find the box",
                           "count points",
                           "start rows",
                           "sort points",
                           "describe bricks",
                           "describe cells",
                           "iteration 0",
                           "iteration 1"};
    for (int s = 0; s < 8; ++s) report.add({fmt::format("step by itself: {}", steps[s]), "ms", device_ms(*swarm, swarm->program(0, true), s)});
    report.add({"step by itself: answer", "ms", device_ms(*swarm, swarm->program(0, true), 6 + sizes.swarm.iterations)});
    const Answer ours = answer(*swarm, 1), theirs = answer(*cpu, 1);
    report.add({"energy found", "", static_cast<double>(ours.cost), "the CPU's, over its own field", static_cast<double>(theirs.cost)});
    energies(*swarm, *cpu);
    fit::ParticleTerms a{}, b{};
    if (!swarm->evaluate(0, centre, a) || !cpu->evaluate(0, centre, b)) throw std::runtime_error("the device was lost");
    report.add({"point term of one particle", "mm", static_cast<double>(a.point), "the CPU's, over its own field", static_cast<double>(b.point)});
    report.add({"plane term of one particle", "mm", static_cast<double>(a.plane), "the CPU's, over its own field", static_cast<double>(b.plane)});
    check_bits(*swarm, sizes);
  }

  /// What the two back-ends find from many seeds: how far apart two runs are by chance alone, and whether one of the fields is worse.
  void energies(fit::SwarmBackend& swarm, fit::SwarmBackend& cpu) const {
    constexpr int kSeeds = 40;
    double sum[2] = {}, squares[2] = {}, difference = 0;
    for (std::uint64_t f = 0; f < kSeeds; ++f) {
      const double e[2] = {static_cast<double>(answer(swarm, f).cost), static_cast<double>(answer(cpu, f).cost)};
      for (int i = 0; i < 2; ++i) sum[i] += e[i], squares[i] += e[i] * e[i];
      difference = std::max(difference, std::abs(e[0] - e[1]) / e[1]);
    }
    const auto deviation_of = [&](int i) { return std::sqrt(std::max(0.0, squares[i] / kSeeds - sum[i] * sum[i] / kSeeds / kSeeds)); };
    report.add({"energy found, mean of 40 seeds", "", sum[0] / kSeeds, "the CPU's, over its own field", sum[1] / kSeeds});
    report.add({"energy found, deviation over 40 seeds", "", deviation_of(0), "the CPU's, over its own field", deviation_of(1)});
    report.add({"largest difference of the two in one seed", "%", 100 * difference});
  }

  /// Frames at a rate (0: as many as go), for whoever reads power and temperature meanwhile.
  void soak() const {
    const fit::BodyModel* model = &subject.model;
    const auto swarm = make_swarm(emulated, {&model, 1}, subject.prior, {});
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    std::vector<double> times;
    for (std::uint64_t f = 0;; ++f) {
      const auto start = Clock::now();
      if (std::chrono::duration<double>(start - begin).count() >= o.soak) break;
      answer(*swarm, f);
      times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
      if (o.rate > 0)
        std::this_thread::sleep_until(begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(static_cast<double>(f + 1) / o.rate)));
    }
    std::sort(times.begin(), times.end());
    report.add({"frames", "", static_cast<double>(times.size())});
    report.add({"whole frame, median", "ms", times[times.size() / 2]});
    report.add({"whole frame, 99th percentile", "ms", times[times.size() * 99 / 100]});
    report.add({"whole frame, longest", "ms", times.back()});
  }

  void scaling(const std::vector<int>& particles, const std::vector<int>& vertices) const {
    const fit::BodyModel* model = &subject.model;
    const auto one = [&](const fit::SwarmSizes& sizes, const std::string& name) {
      const auto swarm = make_swarm(emulated, {&model, 1}, subject.prior, sizes);
      answer(*swarm, 1);
      const double ms = device_ms(*swarm, swarm->program(0, false));
      const fit::EnergyPack pack(subject.model, subject.prior, sizes.energy);
      report.add({name, "ms", ms});
      report.add({name + ": vertex evaluation", "ps", 1e9 * ms / (static_cast<double>(sizes.swarm.particles) * sizes.swarm.iterations * pack.vertices())});
    };
    for (int n : particles) one({.swarm = {.particles = n}}, fmt::format("swarm, {} particles x 10 x {} vertices", n, fit::EnergyPackSettings{}.vertices));
    for (int n : vertices) one({.energy = {.vertices = n}}, fmt::format("swarm, 2000 particles x 10 x {} vertices", n));
  }
};

/// A swarm so small that a checker of memory or races gets through it, with both sizes of block, against the emulated device.
void check_small(const Bench& bench, Report& report) {
  const fit::BodyModel* model = &bench.subject.model;
  for (int particles : {20, 1600}) {
    const fit::SwarmSizes sizes{.swarm = {.particles = particles, .iterations = 2}};
    const auto swarm = make_swarm(bench.emulated, {&model, 1}, bench.subject.prior, sizes),
               emulation = make_swarm(true, {&model, 1}, bench.subject.prior, sizes);
    report.add({fmt::format("{} particles: other bits than the emulated device's", particles), "",
                bench.answer(*swarm, 1) == bench.answer(*emulation, 1) ? 0.0 : 1.0});
  }
}

void run(const Options& given, const Common& common, Report& report) {
  Options o = given;
  if (common.short_form) o.repeats = std::min(o.repeats, 3), o.points = std::min(o.points, 5000), o.clips = 1, o.frames = 2;
  const Bench bench(o, report);
  if (o.check) return check_small(bench, report);
  if (o.soak > 0) return bench.soak();
  if (common.short_form && bench.emulated) {
    bench.scaling({16}, {});
    if (!o.motions.empty()) budget_curve(bench.subject, {o.motions, o.svg, o.clips, o.frames, 1}, {16}, true, report);
    return;
  }
  const auto curve = [&] {
    budget_curve(bench.subject, {o.motions, o.svg, o.clips, o.frames, o.seeds}, {500, 1000, 2000, 5000, 10000, 20000, 50000}, bench.emulated, report);
  };
  if (o.curve) return curve();
  bench.paper_budget();
  bench.scaling({500, 1000, 2000, 5000, 10000, 20000, 50000}, {512, 1024, 2048, 4096, 6000});
  if (!o.motions.empty()) curve();
}

Run make(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option("--backend", o->backend, "cuda, or emulated (slow: its times say nothing)")->check(CLI::IsMember({"cuda", "emulated"}))->capture_default_str();
  app.add_flag("--check", o->check, "Only a small swarm against the emulated device: for compute-sanitizer");
  app.add_option("--soak", o->soak, "Only frames, for so many seconds: for readings of power and temperature")->check(CLI::Range(0.1, 1e5));
  app.add_option("--rate", o->rate, "Frames per second of --soak; 0: as many as go")->check(CLI::Range(0.0, 1e4))->capture_default_str();
  app.add_option("--repeats", o->repeats, "Runs behind each median")->check(CLI::Range(1, 100000))->capture_default_str();
  app.add_option("--points", o->points, "Points of the cloud")->check(CLI::Range(100, 120000))->capture_default_str();
  app.add_option("--motions", o->motions, "Folder of joint angles with held-out clips: adds the curve of error against budget");
  app.add_option("--clips", o->clips, "Held-out clips of that curve")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--seeds", o->seeds, "Runs of each clip with other random numbers")->check(CLI::Range(1, 100))->capture_default_str();
  app.add_flag("--curve", o->curve, "Only that curve");
  app.add_option("--svg", o->svg, "File for a picture of that curve");
  app.add_option("--frames", o->frames, "Frames of each clip")->check(CLI::Range(1, 10000))->capture_default_str();
  return [o](const Common& common, Report& report) { run(*o, common, report); };
}

const Registration registration({"gpu", "Preset paper's swarm on a CUDA device: times by kernel and size, its bits, error against budget", make});

}  // namespace
}  // namespace booth::bench
