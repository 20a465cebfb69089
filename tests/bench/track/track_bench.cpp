// Preset `booth` on one core: what a tracked frame and a first estimate cost, and how far from the truth they are, on bodies and motions nobody trained on.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <ctime>
#include <iostream>
#include <memory>
#include <numeric>

#include "daemon/io/model_file.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"
#include "fit/body/surface_distance.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/support/frame_memory.hpp"

namespace booth::bench {
namespace {

struct Options {
  std::vector<int> bodies{3, 31, 52, 81};
  std::vector<std::string> motions{"walk", "turn", "kick", "squat", "roll-hands", "jump"};
  double seconds = 4;
  int threads = 1, starts = 6;
  bool each = false;
};

struct Figures {
  std::vector<double> cloud_ms, fit_ms, cpu_ms, iterations, start_ms, start_cpu_ms, joints, surface, start_joints;
  int lost = 0, tracked = 0, starts_lost = 0, wrong_sex = 0;
};

double quantile(std::vector<double> v, double p) {
  if (v.empty()) return 0;
  const auto at = v.begin() + static_cast<std::ptrdiff_t>(std::min<double>(static_cast<double>(v.size() - 1), p * static_cast<double>(v.size())));
  std::nth_element(v.begin(), at, v.end());
  return *at;
}
double mean(const std::vector<double>& v) { return v.empty() ? 0 : std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size()); }

/// CPU time of the whole process: what a neighbour steals is not in it.
double cpu_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

daemon::FitModels load_models() {
  const auto folder = daemon::find_models();
  return {std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "men.npz")),
          std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "women.npz")),
          std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz"))};
}

/// Mean distance of the 15 main joints from the truth, metres.
double joint_error(const fit::FitResult& result, const hal::TruthSample& truth) {
  double sum = 0;
  for (int j : fit::main_joints())
    sum += (fit::booth_from_cmu(result.joints.col(j)) - Eigen::Map<const Eigen::Vector3d>(truth.joints[static_cast<std::size_t>(j)].data())).norm();
  return sum / static_cast<double>(fit::main_joints().size());
}

/// Mean distance of every fourth true vertex from the fitted surface, metres.
double surface_error(const fit::Estimator& estimator, const std::vector<std::array<float, 3>>& truth, fit::SurfaceDistance& surface) {
  surface.set(estimator.posed_vertices());
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < truth.size(); i += 4, ++count) sum += static_cast<double>(surface.distance({truth[i][1], truth[i][2], truth[i][0]}));
  return count ? sum / count : 0;
}

/// One recording through cloud and estimator; every so often a first estimate from nothing beside it.
class Follower {
 public:
  Follower(const tests::FrameMemory& memory, const daemon::FitModels& models, int threads)
      : memory_(memory), tracker_(make(memory, models, threads)), starter_(make(memory, models, threads)) {}

  void run(int starts, Figures& out) {
    const std::size_t groups = memory_.frames[0].size();
    for (std::size_t k = 0; k < groups; ++k) {
      const daemon::FitInput input = group(k);
      const auto truth = memory_.truth->at(input.reference);
      daemon::FrameRecord record;
      const double before = cpu_ms();
      tracker_->step(input, record);
      const double spent = cpu_ms() - before;
      const fit::FitResult& result = tracker_->result();
      if (k == 0) continue;  // that one is an estimate
      if (result.state != fit::FitState::tracked) {
        ++out.lost;
        continue;
      }
      ++out.tracked;
      out.cloud_ms.push_back(1e-6 * static_cast<double>(record.stage_ns[static_cast<std::size_t>(daemon::Stage::cloud)]));
      out.fit_ms.push_back(1e-6 * static_cast<double>(record.stage_ns[static_cast<std::size_t>(daemon::Stage::fit)]));
      out.cpu_ms.push_back(spent);
      out.iterations.push_back(result.iterations);
      if (truth) out.joints.push_back(joint_error(result, *truth));
      if (k % 10 == 0) {
        if (!surface_)
          surface_ = std::make_unique<fit::SurfaceDistance>(tracker_->estimator().model().data().faces, tracker_->estimator().model().vertex_count());
        out.surface.push_back(surface_error(tracker_->estimator(), memory_.truth->surface(input.reference), *surface_));
      }
    }
    for (int s = 0; s < starts; ++s) start(static_cast<std::size_t>(s) * groups / static_cast<std::size_t>(starts), out);
  }

 private:
  static std::unique_ptr<daemon::EstimatorFitter> make(const tests::FrameMemory& memory, const daemon::FitModels& models, int threads) {
    fit::CloudSettings cloud;
    cloud.threads = threads;
    fit::EstimatorSettings estimator;
    estimator.threads = threads;
    return std::make_unique<daemon::EstimatorFitter>(memory.cameras, memory.background, models, cloud, estimator);
  }

  daemon::FitInput group(std::size_t k) const {
    daemon::FitInput input;
    input.frame = k;
    hal::Nanoseconds sum{};
    for (std::size_t c = 0; c < memory_.frames.size(); ++c) {
      input.frames[c] = &memory_.frames[c][k];
      sum += memory_.frames[c][k].captured.time_since_epoch();
    }
    input.reference = hal::MonotonicTime(sum / static_cast<int>(memory_.frames.size()));
    return input;
  }

  void start(std::size_t k, Figures& out) {
    starter_->reset();
    const daemon::FitInput input = group(k);
    daemon::FrameRecord record;
    const double before = cpu_ms();
    starter_->step(input, record);
    out.start_cpu_ms.push_back(cpu_ms() - before);
    const fit::FitResult& result = starter_->result();
    out.start_ms.push_back(1e-6 * static_cast<double>(record.stage_ns[static_cast<std::size_t>(daemon::Stage::fit)]));
    if (result.state == fit::FitState::lost) {
      ++out.starts_lost;
      return;
    }
    out.wrong_sex += to_string(result.sex) != memory_.truth->sex();
    if (const auto truth = memory_.truth->at(input.reference)) out.start_joints.push_back(joint_error(result, *truth));
  }

  const tests::FrameMemory& memory_;
  std::unique_ptr<daemon::EstimatorFitter> tracker_, starter_;
  std::unique_ptr<fit::SurfaceDistance> surface_;
};

void append(Figures& to, const Figures& from) {
  for (auto member : {&Figures::cloud_ms, &Figures::fit_ms, &Figures::cpu_ms, &Figures::iterations, &Figures::start_ms, &Figures::start_cpu_ms,
                      &Figures::joints, &Figures::surface, &Figures::start_joints})
    (to.*member).insert((to.*member).end(), (from.*member).begin(), (from.*member).end());
  to.lost += from.lost, to.tracked += from.tracked, to.starts_lost += from.starts_lost, to.wrong_sex += from.wrong_sex;
}

void run(Options options, const Common& common, Report& report) {
  if (common.short_form) options.bodies = {3, 66}, options.motions = {"kick"}, options.seconds = std::min(options.seconds, 1.5), options.starts = 2;
  const daemon::FitModels models = load_models();
  Figures all;
  std::size_t group_bytes = 0;
  for (const std::string& motion : options.motions) {
    for (const int body : options.bodies) {
      std::cerr << "track: body test:" << body << ", " << motion << "\n";
      tests::SceneRequest request;
      request.body = body, request.motion = motion, request.seconds = options.seconds;
      const tests::FrameMemory memory = tests::render_frames(request);
      group_bytes = memory.bytes() / memory.frames[0].size();
      Figures one;
      Follower(memory, models, options.threads).run(options.starts, one);
      if (options.each) {
        std::cerr << fmt::format("  fit {:.2f} ms, 95 % {:.2f}; joints {:.2f} mm, surface {:.2f} mm; lost {}; start {:.0f} ms, joints {:.1f} mm, lost {}\n",
                                 mean(one.fit_ms), quantile(one.fit_ms, 0.95), 1e3 * mean(one.joints), 1e3 * mean(one.surface), one.lost,
                                 quantile(one.start_ms, 0.5), 1e3 * mean(one.start_joints), one.starts_lost);
      }
      append(all, one);
    }
  }
  const double copy_ms = 1e3 * copy_seconds(group_bytes);
  const std::string copy = "copy of the group's images";
  report.note("threads", std::to_string(options.threads));
  report.note("held-out bodies x motions", fmt::format("{} x {}, {:g} s each", options.bodies.size(), options.motions.size(), options.seconds));
  for (const auto& [name, values] : {std::pair{"tracked frame, cloud", &all.cloud_ms},
                                     {"tracked frame, fit", &all.fit_ms},
                                     {"tracked frame, CPU time", &all.cpu_ms},
                                     {"first estimate, fit", &all.start_ms},
                                     {"first estimate, CPU time", &all.start_cpu_ms}}) {
    report.add({fmt::format("{}, mean", name), "ms", mean(*values), copy, copy_ms});
    for (const double p : {0.5, 0.95, 0.99}) report.add({fmt::format("{}, {:g} %", name, 100 * p), "ms", quantile(*values, p), copy, copy_ms});
    report.add({fmt::format("{}, most", name), "ms", quantile(*values, 1), copy, copy_ms});
  }
  report.add({"tracked frames", "", static_cast<double>(all.tracked)});
  report.add({"frames lost", "", static_cast<double>(all.lost)});
  report.add({"iterations of a tracked frame, mean", "", mean(all.iterations)});
  report.add({"15 main joints from the truth, mean", "mm", 1e3 * mean(all.joints)});
  report.add({"15 main joints from the truth, 95 %", "mm", 1e3 * quantile(all.joints, 0.95)});
  report.add({"true surface from the fitted, mean", "mm", 1e3 * mean(all.surface)});
  report.add({"first estimates", "", static_cast<double>(all.start_ms.size())});
  report.add({"first estimates that found nobody", "", static_cast<double>(all.starts_lost)});
  report.add({"first estimates of the other sex", "", static_cast<double>(all.wrong_sex)});
  report.add({"first estimate, joints, mean", "mm", 1e3 * mean(all.start_joints)});
  report.add({"first estimate, joints, 95 %", "mm", 1e3 * quantile(all.start_joints, 0.95)});
}

const Registration kTask(
    {"track", "Preset booth: a tracked frame and a first estimate on one core, and their errors on held-out bodies and motions", [](CLI::App& app) -> Run {
       auto options = std::make_shared<Options>();
       app.add_option("--body", options->bodies, "Set-aside bodies, 1 to 90")->check(CLI::Range(1, 90))->capture_default_str();
       app.add_option("--motion", options->motions, "Motions by name, or files that end in .npy, .amc or .bvh")->capture_default_str();
       app.add_option("--seconds", options->seconds, "Of each motion")->check(CLI::Range(0.5, 600.0))->capture_default_str();
       app.add_option("--threads", options->threads, "Workers of cloud and fit")->check(CLI::Range(1, 64))->capture_default_str();
       app.add_option("--starts", options->starts, "First estimates for each body and motion")->check(CLI::Range(1, 1000))->capture_default_str();
       app.add_flag("--each", options->each, "A line on stderr for each body and motion");
       return [options](const Common& common, Report& report) { run(*options, common, report); };
     }});

}  // namespace
}  // namespace booth::bench
