// What more particles buy: held-out motions followed with every size of swarm, on clouds without any camera's shadow.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/io/mocap_folder.hpp"
#include "daemon/io/model_file.hpp"
#include "fit/body/skeleton.hpp"
#include "tests/bench/gpu/gpu_bench.hpp"

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

}  // namespace

void budget_curve(const Subject& subject, const std::filesystem::path& motions, int clips, int frames, const std::vector<int>& particles, bool emulated,
                  Report& report) {
  const daemon::MotionFolder folder = daemon::load_motion_folder(motions, daemon::find_models() / "held_out_motions.csv");
  std::vector<const daemon::MotionClip*> chosen;
  for (const daemon::MotionClip& c : folder.clips)
    if (c.use == daemon::MotionUse::held_out && c.frames > frames) chosen.push_back(&c);
  if (chosen.empty()) throw std::runtime_error(fmt::format("bench gpu: {} has no held-out clip of more than {} frames", motions.string(), frames));
  const std::size_t count = std::min(chosen.size(), static_cast<std::size_t>(clips));
  const fit::BodyModel* model = &subject.model;
  for (int n : particles) {
    const auto swarm = make_swarm(emulated, {&model, 1}, subject.prior, {.swarm = {.particles = n}});
    const int d = swarm->dimensions(0);
    const std::vector<float> deviation = tracking_deviation(subject.prior, d);
    std::vector<double> errors;
    int lost = 0;
    for (std::size_t c = 0; c < count; ++c) {
      const daemon::MotionClip& clip = *chosen[c * chosen.size() / count];
      std::vector<float> last(static_cast<std::size_t>(d), 0.0f);
      for (int k = 0; k < fit::kDofs; ++k) last[static_cast<std::size_t>(k)] = folder.q(k, clip.start);
      for (int f = 1; f <= frames; ++f) {
        const fit::PoseVector q = folder.q.col(clip.start + f).cast<double>();
        const fit::Cloud cloud = surface_cloud(subject.model, subject.beta, q, kPoints, kNoise, static_cast<unsigned>(f));
        fit::SwarmResult r;
        if (!swarm->set_cloud(cloud) || !swarm->minimise(0, last, deviation, {1, static_cast<std::uint64_t>(f)}, r))
          throw std::runtime_error("bench gpu: the device was lost");
        std::copy(r.best.begin(), r.best.end(), last.begin());
        errors.push_back(joint_error(subject.model, last, q, subject.beta));
        lost += errors.back() > 0.15;
      }
    }
    double sum = 0;
    for (double e : errors) sum += e;
    std::sort(errors.begin(), errors.end());
    const std::string name = fmt::format("held-out motions, {} particles x 10: ", n);
    report.add({name + "mean joint error", "mm", 1e3 * sum / static_cast<double>(errors.size())});
    report.add({name + "median joint error", "mm", 1e3 * errors[errors.size() / 2]});
    report.add({name + "95th percentile", "mm", 1e3 * errors[errors.size() * 95 / 100]});
    report.add({name + "frames off by more than 150 mm", "%", 100.0 * lost / static_cast<double>(errors.size())});
  }
}

}  // namespace booth::bench
