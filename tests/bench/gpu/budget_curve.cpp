// What more particles buy: held-out motions followed with every size of swarm, on clouds without any camera's shadow.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <thread>

#include "daemon/io/mocap_folder.hpp"
#include "daemon/io/model_file.hpp"
#include "fit/body/skeleton.hpp"
#include "fit/parallel.hpp"
#include "tests/bench/gpu/gpu_bench.hpp"
#include "tests/support/line_chart.hpp"

namespace booth::bench {
namespace {

constexpr int kPoints = 20000;
constexpr float kNoise = 0.003f;  // m

/// Mean distance of the main joints, m.
double joint_error(const fit::BodyModel& model, std::span<const float> particle, const fit::PoseVector& q, const fit::ShapeVector& beta) {
  fit::PoseVector found;
  for (int k = 0; k < fit::kDofs; ++k) found[k] = static_cast<double>(particle[static_cast<std::size_t>(k)]);
  fit::ShapeVector shape(static_cast<Eigen::Index>(particle.size()) - fit::kDofs);
  for (Eigen::Index k = 0; k < shape.size(); ++k) shape[k] = static_cast<double>(particle[static_cast<std::size_t>(fit::kDofs + k)]);
  fit::Kinematics a, b;
  fit::forward_kinematics(found, model.bone_vectors(shape), a);
  fit::forward_kinematics(q, model.bone_vectors(beta), b);
  double sum = 0;
  for (int j : fit::main_joints()) sum += (a.joint.col(j) - b.joint.col(j)).norm();
  return sum / static_cast<double>(fit::main_joints().size());
}

/// One clip's frames, made once for all sizes of swarm.
struct Clip {
  std::vector<float> before;  ///< where the first frame's swarm starts
  std::vector<fit::PoseVector> q;
  std::vector<fit::Cloud> cloud;
};

std::vector<Clip> make_clips(const Subject& subject, const BudgetCurve& what) {
  const daemon::MotionFolder folder = daemon::load_motion_folder(what.motions, daemon::find_models() / "held_out_motions.csv");
  std::vector<const daemon::MotionClip*> chosen;
  for (const daemon::MotionClip& c : folder.clips)
    if (c.use == daemon::MotionUse::held_out && c.frames > what.frames) chosen.push_back(&c);
  if (chosen.empty()) throw std::runtime_error(fmt::format("{} has no held-out clip of more than {} frames", what.motions.string(), what.frames));
  std::vector<Clip> out(std::min(chosen.size(), static_cast<std::size_t>(what.clips)));
  fit::WorkerPool pool(std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 32));
  pool.run(static_cast<int>(out.size()), [&](int i) {
    Clip& clip = out[static_cast<std::size_t>(i)];
    const daemon::MotionClip& from = *chosen[static_cast<std::size_t>(i) * chosen.size() / out.size()];
    for (int k = 0; k < fit::kDofs; ++k) clip.before.push_back(folder.q(k, from.start));
    for (int f = 1; f <= what.frames; ++f) {
      clip.q.push_back(folder.q.col(from.start + f).cast<double>());
      clip.cloud.push_back(surface_cloud(subject.model, subject.beta, clip.q.back(), kPoints, kNoise, static_cast<unsigned>(f)));
    }
  });
  return out;
}

struct Row {
  int particles;
  double mean, median, p95;
};

void draw(const std::filesystem::path& file, const std::vector<Row>& rows) {
  tests::LineChart chart{
      .title = "Held-out motions: joint error against the swarm's size", .x_label = "particles (10 iterations)", .y_label = "mm", .log_x = true, .lines = {}};
  const auto line = [&](const char* name, double Row::*value) {
    tests::LineChart::Line l{.name = name, .x = {}, .y = {}};
    for (const Row& r : rows) l.x.push_back(r.particles), l.y.push_back(r.*value);
    chart.lines.push_back(l);
  };
  line("95 % of frames", &Row::p95), line("mean", &Row::mean), line("median", &Row::median);
  std::ofstream out(file);
  if (!(out << tests::to_svg(chart)).flush()) throw std::runtime_error(file.string() + " cannot be written");
}

}  // namespace

void budget_curve(const Subject& subject, const BudgetCurve& what, const std::vector<int>& particles, bool emulated, Report& report) {
  const std::vector<Clip> clips = make_clips(subject, what);
  const fit::BodyModel* model = &subject.model;
  std::vector<Row> rows;
  for (int n : particles) {
    const auto swarm = make_swarm(emulated, {&model, 1}, subject.prior, {.swarm = {.particles = n}});
    const int d = swarm->dimensions(0);
    const std::vector<float> deviation = tracking_deviation(subject.prior, d);
    std::vector<double> errors, of_seed(static_cast<std::size_t>(what.seeds), 0);
    int lost = 0;
    for (int seed = 0; seed < what.seeds; ++seed)
      for (const Clip& clip : clips) {
        std::vector<float> last = clip.before;
        last.resize(static_cast<std::size_t>(d), 0.0f);
        for (std::size_t f = 0; f < clip.q.size(); ++f) {
          fit::SwarmResult r;
          if (!swarm->set_cloud(clip.cloud[f]) || !swarm->minimise(0, last, deviation, {static_cast<std::uint64_t>(1 + seed), f + 1}, r))
            throw std::runtime_error("the device was lost");
          std::copy(r.best.begin(), r.best.end(), last.begin());
          errors.push_back(joint_error(subject.model, last, clip.q[f], subject.beta));
          of_seed[static_cast<std::size_t>(seed)] += errors.back();
          lost += errors.back() > 0.15;
        }
      }
    double sum = 0;
    for (double e : errors) sum += e;
    const auto [least, most] = std::minmax_element(of_seed.begin(), of_seed.end());
    const double frames = static_cast<double>(clips.size() * clips.front().q.size());
    std::sort(errors.begin(), errors.end());
    rows.push_back({n, 1e3 * sum / static_cast<double>(errors.size()), 1e3 * errors[errors.size() / 2], 1e3 * errors[errors.size() * 95 / 100]});
    const std::string name = fmt::format("held-out motions, {} particles x 10: ", n);
    report.add({name + "mean joint error", "mm", rows.back().mean});
    report.add({name + "mean of the best seed", "mm", 1e3 * *least / frames});
    report.add({name + "mean of the worst seed", "mm", 1e3 * *most / frames});
    report.add({name + "median joint error", "mm", rows.back().median});
    report.add({name + "95th percentile", "mm", rows.back().p95});
    report.add({name + "frames off by more than 150 mm", "%", 100.0 * lost / static_cast<double>(errors.size())});
  }
  if (!what.svg.empty()) draw(what.svg, rows);
}

}  // namespace booth::bench
