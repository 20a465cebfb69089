// Task `swarm`: preset paper's whole budget, by kernel and threads, beside the scalar reference, a plain copy and the machine's peak of arithmetic.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "fit/swarm/backend.hpp"
#include "fit/swarm/swarm_kernel.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/bench/support/body_cloud.hpp"
#include "tests/bench/swarm/peak.hpp"

namespace booth::bench {
namespace {

struct Options {
  std::string kernel;
  int repeats = 15, points = 60000, particles = 2000, iterations = 10, vertices = 1008;
};

/// Multiply-adds that one vertex takes by the formulas: 15 coefficients of 6 numbers, the blend, position and normal, difference, two lengths, a product.
double multiply_adds(const fit::EnergyPack& pack) {
  double blended = 0;
  for (const fit::Segment& s : pack.segment()) blended += (s.end - s.begin) * (s.count - 1) * 12;
  return 6 * pack.shape_count() + blended / pack.vertices() + 18 + 3 + 9;
}

void run(const Options& given, const Common& common, Report& report) {
  Options o = given;
  if (common.short_form) o.repeats = 1, o.particles = std::min(o.particles, 64), o.iterations = std::min(o.iterations, 3), o.points = std::min(o.points, 5000);
  const Subject subject = load_subject();
  const fit::Cloud cloud = surface_cloud(subject.model, subject.beta, subject.q, o.points, 0.003f, 1);
  const fit::SwarmSizes sizes{.swarm = {.particles = o.particles, .iterations = o.iterations}, .energy = {.vertices = o.vertices}};
  const fit::EnergyPack pack(subject.model, subject.prior, sizes.energy);
  std::vector<float> centre(static_cast<std::size_t>(pack.dimensions())), deviation(centre.size(), 1.0f);
  for (int k = 0; k < fit::kDofs; ++k) centre[static_cast<std::size_t>(k)] = static_cast<float>(subject.q[k]) + (k < 3 ? 0.03f : 0.05f);
  for (int k = 0; k < fit::kDofs; ++k)
    deviation[static_cast<std::size_t>(k)] = k < 3 ? 0.1f : k < 6 ? 0.2f : static_cast<float>(subject.prior.standard_deviation[k - 6]);
  const double evaluations = static_cast<double>(o.particles) * o.iterations * pack.vertices();
  const fit::BodyModel* model = &subject.model;

  int count = 0;
  const fit::SwarmKernel* kernels = fit::swarm_kernels(count);
  double scalar[3] = {};
  std::uint64_t frame = 0;
  for (int threads : {1, 2}) {
    fit::WorkerPool pool(threads);
    for (int k = 0; k < count; ++k) {
      if (!kernels[k].available() || (!o.kernel.empty() && o.kernel != kernels[k].name)) continue;
      const auto swarm = fit::make_cpu_swarm({&model, 1}, subject.prior, sizes, pool, kernels[k].name);
      fit::SwarmResult result;
      bool good = true;
      const std::vector<double> seconds =
          median_seconds_in_turns(k == 0 ? std::min(o.repeats, 3) : o.repeats, {
                                                                                   [&] { good = swarm->set_cloud(cloud) && good; },
                                                                                   [&] {
                                                                                     good = swarm->minimise(0, centre, deviation, {1, frame++}, result) && good;
                                                                                   },
                                                                               });
      if (!good) throw std::runtime_error("the back-end was lost");
      const std::string name = fmt::format("{} x{}", kernels[k].name, threads);
      const double ns = 1e9 * seconds[1] / evaluations;
      if (k == 0) scalar[threads] = ns;
      report.add({name + ": frames per second, field included", "1/s", 1 / (seconds[0] + seconds[1])});
      report.add({name + ": field", "ms", 1e3 * seconds[0]});
      report.add({name + ": swarm", "ms", 1e3 * seconds[1]});
      report.add({name + ": vertex evaluation", "ns", ns, scalar[threads] > 0 ? fmt::format("scalar x{}", threads) : "", scalar[threads]});
      if (const double peak = peak_multiply_adds(kernels[k].name); peak > 0 && threads == 1)
        report.add({name + ": vertex evaluation", "ns", ns, "arithmetic floor: its multiply-adds at the peak measured here", 1e9 * multiply_adds(pack) / peak});
      if (k == count - 1) report.add({"energy found", "", static_cast<double>(result.cost), "first iteration's", static_cast<double>(result.history.front())});
    }
  }
  // A group of 16 particles reads the packed vertices once an iteration; position, velocity and best are read and written.
  const double groups = std::ceil(o.particles / 16.0) * o.iterations;
  const double bytes = groups * (static_cast<double>(pack.memory_bytes()) + 16.0 * pack.dimensions() * 4 * 6);
  report.add({"plain copy of the bytes that one frame reads and writes", "ns per vertex evaluation",
              1e9 * copy_seconds(static_cast<std::size_t>(bytes)) / evaluations});
}

Run make(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option("--kernel", o->kernel, "Only this kernel; there is no ratio to the scalar reference then");
  app.add_option("--repeats", o->repeats, "Frames measured for each kernel")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--points", o->points, "Points of the cloud")->check(CLI::Range(100, 120000))->capture_default_str();
  app.add_option("--particles", o->particles, "Particles")->check(CLI::Range(1, 1000000))->capture_default_str();
  app.add_option("--iterations", o->iterations, "Iterations")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--vertices", o->vertices, "Vertices compared")->check(CLI::Range(16, 6000))->capture_default_str();
  return [o](const Common& common, Report& report) { run(*o, common, report); };
}

const Registration registration({"swarm", "Preset paper's swarm and field: frames/s by kernel and threads, ns for each vertex, beside the machine's floors",
                                 make});

}  // namespace
}  // namespace booth::bench
