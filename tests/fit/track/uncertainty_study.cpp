// booth-uncertainty-study: are joint covariances and standard deviations of measurements what they say? Also finds the constants that make them so.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>

#include "daemon/io/model_file.hpp"
#include "daemon/io/motion_file.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/pipeline/offline_run.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"
#include "fit/track/joint_uncertainty.hpp"
#include "hal/ground_truth.hpp"

namespace booth::tests {
namespace {

struct Options {
  std::vector<int> bodies{4, 27, 48, 71};
  std::vector<std::string> motions{"walk", "squat"};  // names, or FILE.npy@SECOND
  double seconds = 2;
  int hidden = 0;  // of the four cameras, so many see nothing
  bool constants = false, in_turn = false;
};

struct JointSample {
  int joint;
  bool seen;
  Eigen::Vector3d error;
  Eigen::Matrix3d covariance, curvature;
};
struct MeasureSample {
  int measure;
  double error, sd, carried;
};

struct Samples {
  std::vector<JointSample> joints;
  std::vector<MeasureSample> measures;
};

void run_one(const Options& options, int number, const std::string& motion_text, Samples& out) {
  const auto folder = daemon::find_models();
  const daemon::TestBody body = daemon::load_test_body(folder / "test_bodies.npz", number);
  const auto model = std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / (std::string(to_string(body.sex)) + ".npz")));
  const auto truth = fit::Measurer(model->data()).measure(body.rest, body.rest_joints);
  const auto contact = drivers::contact_of(*model, body.rest, body.rest_joints);
  drivers::Motion motion;
  const std::size_t at = motion_text.find('@');
  const std::string name = motion_text.substr(0, at);
  if (daemon::is_motion_file(name)) {
    motion.frames = daemon::read_motion(name);
    const auto first = at == std::string::npos ? 0 : static_cast<std::ptrdiff_t>(std::stod(motion_text.substr(at + 1)) * motion.rate);
    if (first >= static_cast<std::ptrdiff_t>(motion.frames.size())) throw std::invalid_argument(motion_text + ": the motion ends before");
    motion.frames.erase(motion.frames.begin(), motion.frames.begin() + first);
    motion.frames.resize(std::min(motion.frames.size(), static_cast<std::size_t>((options.seconds + 1) * motion.rate)));
    drivers::place_on_stage(motion, contact, {.leg_scale = drivers::leg_scale(*model, body.rest_joints)});
  } else {
    motion = drivers::motion_by_name(name, 0, contact);
  }
  drivers::SceneSettings settings;
  settings.cameras = drivers::camera_ring();
  settings.cameras.resize(settings.cameras.size() - static_cast<std::size_t>(options.hidden));
  settings.noise = drivers::NoiseModel::parse("kinect2");
  settings.seed = static_cast<std::uint64_t>(number);
  settings.pace = drivers::Pace::fast;
  settings.seconds = options.seconds;
  std::vector<drivers::Person> persons;
  persons.push_back(drivers::make_person("test", model, body.rest, body.rest_joints, std::move(motion)));
  drivers::Source source = drivers::make_scene(settings, std::move(persons), std::make_shared<drivers::ManualClock>());

  daemon::Config config;
  daemon::FitSetup setup = daemon::make_fit_setup(config, source.cameras, source.background);
  std::vector<fit::Measurement> last;
  double joint_error = 0;
  int frames = 0, lost = 0;
  daemon::run_offline(source.cameras, 1, *setup.fitter, [&](const daemon::FitInput& input, const daemon::FrameRecord& record) {
    const fit::FitResult& result = setup.fitter->result();
    const auto sample = source.truth->at(input.reference);
    if (record.person == daemon::PersonState::lost || !sample) return ++lost, true;
    for (int j = 0; j < fit::kJoints; ++j) {
      const auto& p = sample->joints[static_cast<std::size_t>(j)];
      const auto k = static_cast<std::size_t>(j);
      const Eigen::Vector3d error = result.joints.col(j) - fit::cmu_from_booth({p[0], p[1], p[2]});
      out.joints.push_back({j, result.visibility[k] == fit::JointVisibility::seen, error, result.joint_covariance[k],
                            fit::curvature_of(result.joint_covariance[k], j, result.visibility[k], result.coverage)});
      joint_error += error.norm() / fit::kJoints;
    }
    if (++frames % 30 == 1) last = fit::measure_with_sd(setup.fitter->estimator().model(), result.beta, result.shape_covariance);
    return true;
  });
  for (std::size_t m = 0; m < last.size(); ++m)
    out.measures.push_back({static_cast<int>(m), last[m].value - truth[m], last[m].sd, fit::propagated_variance_of(static_cast<fit::Measure>(m), last[m].sd)});
  fmt::print("body {:>2} {:<40} {:>3} frames, {} lost, joints {:.1f} mm\n", number, motion_text, frames, lost, 1e3 * joint_error / std::max(frames, 1));
  std::fflush(stdout);
}

/// Square of the error in standard deviations, in three dimensions.
double mahalanobis2(const JointSample& s, const Eigen::Matrix3d& covariance) { return s.error.dot(covariance.ldlt().solve(s.error)); }

constexpr double kChi68 = 3.5059, kChi95 = 7.8147;  // of three degrees of freedom

struct Coverage {
  double in68 = 0, in95 = 0;
};
template <typename Covariance>
Coverage coverage(const std::vector<const JointSample*>& samples, Covariance covariance_of) {
  Coverage c;
  for (const JointSample* s : samples) {
    const double m = mahalanobis2(*s, covariance_of(*s));
    c.in68 += m < kChi68, c.in95 += m < kChi95;
  }
  const double n = std::max<double>(1, static_cast<double>(samples.size()));
  return {100 * c.in68 / n, 100 * c.in95 / n};
}

void report_joints(const Samples& all, bool constants) {
  std::map<std::pair<bool, int>, std::vector<const JointSample*>> groups;
  for (const JointSample& s : all.joints) groups[{s.seen, s.joint}].push_back(&s);
  fmt::print("\n{:<14} {:<9} {:>7} {:>8} {:>8} {:>7} {:>7}{}\n", "joint", "state", "samples", "error mm", "sd mm", "in 68%", "in 95%",
             constants ? "   scale   own mm" : "");
  std::map<bool, std::vector<const JointSample*>> whole;
  for (const auto& [key, samples] : groups) {
    double error = 0, sd = 0;
    for (const JointSample* s : samples) error += s->error.norm(), sd += std::sqrt(s->covariance.trace());
    const auto n = static_cast<double>(samples.size());
    const Coverage c = coverage(samples, [](const JointSample& s) { return s.covariance; });
    fmt::print("{:<14} {:<9} {:>7} {:>8.1f} {:>8.1f} {:>7.1f} {:>7.1f}", fit::bones()[static_cast<std::size_t>(key.second)].end_joint,
               key.first ? "seen" : "inferred", samples.size(), 1e3 * error / n, 1e3 * sd / n, c.in68, c.in95);
    if (constants && samples.size() > 20) {
      // The likeliest pair of constants, then both scaled so that 68 % lie inside.
      double best = 1e300, best_scale = 0, best_own = 0;
      for (double scale = 0.1; scale < 6; scale *= 1.25)
        for (double own = 0.001; own < 0.2; own *= 1.2) {
          double cost = 0;
          for (const JointSample* s : samples) {
            const Eigen::Matrix3d m = scale * scale * s->curvature + own * own * Eigen::Matrix3d::Identity();
            cost += std::log(m.determinant()) + std::min(mahalanobis2(*s, m), 25.0);
          }
          if (cost < best) best = cost, best_scale = scale, best_own = own;
        }
      std::vector<double> m;
      for (const JointSample* s : samples)
        m.push_back(mahalanobis2(*s, best_scale * best_scale * s->curvature + best_own * best_own * Eigen::Matrix3d::Identity()));
      std::nth_element(m.begin(), m.begin() + static_cast<std::ptrdiff_t>(0.72 * n), m.end());
      const double stretch = std::sqrt(m[static_cast<std::size_t>(0.72 * n)] / kChi68);
      fmt::print("   {:.2f}   {:.1f}", stretch * best_scale, 1e3 * stretch * best_own);
    }
    fmt::print("\n");
    whole[key.first].insert(whole[key.first].end(), samples.begin(), samples.end());
  }
  for (const auto& [seen, samples] : whole) {
    const Coverage c = coverage(samples, [](const JointSample& s) { return s.covariance; });
    fmt::print("all {:<9} {:>9}: {:.1f} % within the 68 % ellipsoid, {:.1f} % within the 95 % one\n", seen ? "seen" : "inferred", samples.size(), c.in68,
               c.in95);
  }
}

void report_measures(const Samples& all, bool constants) {
  fmt::print("\n{:<18} {:>7} {:>9} {:>9} {:>9} {:>9} {:>10}\n", "measure", "samples", "mean err", "mean |e|", "mean sd", "carried", "in 90 %");
  for (int m = 0; m < fit::kMeasures; ++m) {
    double mean = 0, absolute = 0, sd = 0, carried = 0, inside = 0, n = 0;
    std::vector<const MeasureSample*> samples;
    for (const MeasureSample& s : all.measures)
      if (s.measure == m) samples.push_back(&s);
    for (const MeasureSample* s : samples)
      mean += s->error, absolute += std::abs(s->error), sd += s->sd, carried += std::sqrt(s->carried), inside += std::abs(s->error) < 1.645 * s->sd, ++n;
    const auto unit = fit::measure_unit(static_cast<fit::Measure>(m));
    const double to = unit == "m" ? 100 : unit == "m^3" ? 1000 : 1;
    fmt::print("{:<18} {:>7} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>10.1f} {}", fit::measure_name(static_cast<fit::Measure>(m)), n, to * mean / n,
               to * absolute / n, to * sd / n, to * carried / n, 100 * inside / n,
               unit == "m"     ? "cm"
               : unit == "m^3" ? "l"
                               : "kg");
    if (constants) {
      // The smallest constant with which 92 of 100 lie inside.
      double own = 0;
      for (; own < 10; own += 1e-4 * std::max(1.0, 1 / to)) {
        double in = 0;
        for (const MeasureSample* s : samples) in += std::abs(s->error) < 1.645 * std::sqrt(s->carried + own * own);
        if (in >= 0.92 * n) break;
      }
      fmt::print("   unexplained {:.5f}", own);
    }
    fmt::print("\n");
  }
}

}  // namespace
}  // namespace booth::tests

int main(int argc, char** argv) {
  using namespace booth::tests;
  Options options;
  CLI::App app{
      "Joint covariances and measurement deviations against the truth, on simulated Kinect v2 cameras. $BOOTHD_MODELS may name another folder of test bodies."};
  app.add_option("--bodies", options.bodies, "Numbers in test_bodies.npz")->capture_default_str();
  app.add_option("--motions", options.motions, "Names of motions, or FILE.npy@SECOND")->capture_default_str();
  app.add_option("--seconds", options.seconds, "Of each run")->capture_default_str();
  app.add_option("--hidden", options.hidden, "Cameras left out")->check(CLI::Range(0, 3))->capture_default_str();
  app.add_flag("--in-turn", options.in_turn, "Each body gets one motion, in turn, instead of all of them");
  app.add_flag("--constants", options.constants, "Also print the constants that would fit");
  try {
    app.parse(argc, argv);
    Samples samples;
    for (std::size_t b = 0; b < options.bodies.size(); ++b)
      for (std::size_t m = 0; m < (options.in_turn ? 1 : options.motions.size()); ++m)
        run_one(options, options.bodies[b], options.motions[options.in_turn ? b % options.motions.size() : m], samples);
    report_joints(samples, options.constants);
    report_measures(samples, options.constants);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::cerr << "booth-uncertainty-study: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
