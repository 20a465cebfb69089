// What the roundings of preset `paper`'s kernels cost: bodies found by the swarm over known clouds, and the kernel's energies beside the reference's.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <random>
#include <vector>

#include "daemon/io/model_file.hpp"
#include "fit/swarm/backend.hpp"
#include "fit/track/paper_fitter.hpp"
#include "tests/bench/support/body_cloud.hpp"

namespace {

using namespace booth;

struct Options {
  int bodies = 60, points = 30000, swarms = 3, threads = 2;
  float noise = 0.003f;
  std::string kernel, sex = "men";
};

/// Mean and its standard error.
struct Average {
  int n = 0;
  double sum = 0, squares = 0;
  void add(double x) { ++n, sum += x, squares += x * x; }
  double mean() const { return sum / n; }
  double error() const { return std::sqrt(std::max(squares / n - mean() * mean(), 0.0) / std::max(n - 1, 1)); }
};

/// A typical pose, each angle a third of its deviation away from it, and a heading.
fit::PoseVector random_pose(const fit::PosePrior& prior, std::mt19937& random) {
  std::normal_distribution<double> gauss;
  std::uniform_int_distribution<Eigen::Index> pick(0, prior.exemplars.cols() - 1);
  std::uniform_real_distribution<double> heading(-3, 3);
  fit::PoseVector q = prior.exemplars.col(pick(random));
  for (int k = 0; k < fit::kPoseDofs; ++k) q[fit::kRootDofs + k] += prior.standard_deviation[k] / 3 * gauss(random);
  q[4] = heading(random);
  return q;
}

double mean_distance(const fit::BodyModel& model, const fit::ShapeVector& beta, const fit::PoseVector& q, std::span<const float> particle) {
  fit::ShapeVector found_beta = fit::ShapeVector::Zero(model.shape_count());
  fit::PoseVector found;
  for (int k = 0; k < fit::kDofs; ++k) found[k] = static_cast<double>(particle[static_cast<std::size_t>(k)]);
  for (std::size_t k = fit::kDofs; k < particle.size(); ++k) found_beta[static_cast<Eigen::Index>(k) - fit::kDofs] = static_cast<double>(particle[k]);
  fit::Vertices a, b;
  model.posed(beta, q, a);
  model.posed(found_beta, found, b);
  return static_cast<double>((a - b).colwise().norm().mean());
}

void run(const Options& o) {
  const auto folder = daemon::find_models();
  const fit::BodyModel model = daemon::load_body_model(folder / (o.sex + ".npz"));
  const fit::PosePrior prior = daemon::load_pose_prior(folder / "pose.npz");
  const fit::BodyModel* one = &model;
  fit::WorkerPool pool(o.threads);
  const fit::SwarmSizes sizes{.energy = {.vertices = fit::PaperFitter::kVertices}};
  const auto swarm = fit::make_cpu_swarm({&one, 1}, prior, sizes, pool, o.kernel);
  const auto n = static_cast<std::size_t>(swarm->dimensions(0));
  std::vector<Average> error(static_cast<std::size_t>(o.swarms));
  Average cost, off;
  std::mt19937 random(9);
  std::normal_distribution<double> gauss;
  for (int body = 0; body < o.bodies; ++body) {
    fit::ShapeVector beta = fit::ShapeVector::Zero(model.shape_count());
    for (int k = 0; k < fit::PaperFitter::kShapeCount; ++k) beta[k] = gauss(random);
    const fit::PoseVector q = random_pose(prior, random);
    const fit::Cloud cloud = bench::surface_cloud(model, beta, q, o.points, o.noise, static_cast<unsigned>(body));
    std::vector<float> centre(n, 0.0f), deviation(n, 1.0f);
    for (std::size_t k = 0; k < fit::kDofs; ++k) {
      const auto d = static_cast<Eigen::Index>(k);
      deviation[k] = k < 3 ? 0.10f : k < 6 ? 0.20f : static_cast<float>(prior.standard_deviation[d - fit::kRootDofs]);  // as fit/track/paper_fitter.cpp's
      centre[k] = static_cast<float>(q[d] + (k < 3 ? 0.03 : static_cast<double>(deviation[k]) / 3) * gauss(random));
    }
    if (!swarm->set_cloud(cloud)) throw std::runtime_error("the back-end was lost");
    for (int turn = 0; turn < o.swarms; ++turn) {
      fit::SwarmResult found;
      if (!swarm->minimise(0, centre, deviation, {1, static_cast<std::uint64_t>(body * o.swarms + turn)}, found))
        throw std::runtime_error("the back-end was lost");
      centre.assign(found.best.begin(), found.best.end());
      error[static_cast<std::size_t>(turn)].add(100 * mean_distance(model, beta, q, centre));
      if (turn + 1 < o.swarms) continue;
      fit::ParticleTerms t{};
      if (!swarm->evaluate(0, centre, t)) throw std::runtime_error("the back-end was lost");
      const fit::PaperWeights w;
      const double reference = w.point * static_cast<double>(t.point) + w.plane * static_cast<double>(t.plane) + w.shape * static_cast<double>(t.shape) +
                               w.bone * static_cast<double>(t.bone) + w.pose * static_cast<double>(t.pose);
      cost.add(reference), off.add(static_cast<double>(found.cost) / reference - 1);
    }
  }
  fmt::print("{} bodies ({}), {} points, {}: mean distance of vertices\n", o.bodies, o.sex, o.points, swarm->name());
  for (std::size_t turn = 0; turn < error.size(); ++turn)
    fmt::print("  after swarm {}: {:.3f} +- {:.3f} cm\n", turn + 1, error[turn].mean(), error[turn].error());
  fmt::print("  reference's energy at what was found: {:.0f} +- {:.0f}; the kernel's is {:+.3f} % off on average, +- {:.3f} % from body to body\n", cost.mean(),
             cost.error(), 100 * off.mean(), 100 * off.error() * std::sqrt(static_cast<double>(off.n)));
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CLI::App app("What preset paper's swarm finds over known clouds, kernel by kernel (docs/design/performance.md)");
  app.add_option("--bodies", o.bodies, "Random bodies and poses")->check(CLI::Range(1, 100000))->capture_default_str();
  app.add_option("--points", o.points, "Points of each cloud")->check(CLI::Range(100, 120000))->capture_default_str();
  app.add_option("--noise", o.noise, "Deviation of the points along each axis, m")->check(CLI::Range(0.0f, 0.1f))->capture_default_str();
  app.add_option("--swarms", o.swarms, "Swarms one after the other on each cloud")->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--threads", o.threads, "Threads")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--kernel", o.kernel, "The kernel; default: the best here");
  app.add_option("--sex", o.sex, "Whose model")->check(CLI::IsMember({"men", "women"}))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    run(o);
  } catch (const std::exception& e) {
    fmt::print(stderr, "booth-swarm-study: {}\n", e.what());
    return 1;
  }
}
