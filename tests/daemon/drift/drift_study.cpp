// How large the drift watch's figures are where no camera has moved, and how soon it notices one that has: the study behind fit/calibrate/drift_watch.hpp.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include "fit/calibrate/drift_watch.hpp"
#include "tests/daemon/drift/drift_scene.hpp"

namespace booth::tests {
namespace {

using fit::calibrate::CameraVerdict;
using fit::calibrate::DriftWatch;
using fit::calibrate::Vector6;

struct Options {
  std::vector<int> bodies{3, 31, 52, 81};
  std::vector<std::string> motions{"walk", "kick", "squat", "wave", "showcase"};
  double seconds = 40, knocked_at = 8;
  std::vector<double> degrees{}, centimetres{};
  std::uint64_t seed = 1;
  bool every = false;  // judgement
};

struct Outcome {
  double detected = -1, false_seconds = 0, followed = 0, largest = 0, largest_ratio = 0;
  std::vector<double> displacement, ratio;
  int wrong = 0;  // other cameras that were named
  double watch_ms = 0, watch_most_ms = 0, step_ms = 0;
  int frames = 0;
};

Outcome watch(const DriftScene& scene, const Options& o) {
  Outcome out;
  fit::calibrate::PersonSystemSettings settings;
  settings.cameras = scene.cameras;
  DriftWatch drift(drift_models().men, drift_models().women, settings);
  play(scene, [&](const DriftFrame& f) {
    if (f.fitter->result().state == fit::FitState::tracked) out.followed += 1 / 30.0;
    const double before = thread_ms();
    const bool judged = drift.observe(f.fitter->observation(), f.fitter->result());
    const double took = thread_ms() - before;
    if (f.record->body_accepted != 0) {
      out.watch_ms += took;
      out.watch_most_ms = std::max(out.watch_most_ms, took);
      out.step_ms += f.milliseconds;
      ++out.frames;
    }
    if (!judged) return true;
    for (int c = 0; c < scene.cameras; ++c) {
      const auto& camera = drift.camera(c);
      const auto& says = camera.says;
      const bool alarm = camera.verdict == CameraVerdict::moved || camera.verdict == CameraVerdict::blind;
      if (says.deviation > 0 && c != scene.knocked) {
        out.displacement.push_back(says.displacement);
        out.ratio.push_back(says.displacement / says.deviation);
      }
      if (o.every) {
        std::cout << fmt::format("{:6.1f} s camera {} {:6.2f} mm ({:.2f})", f.time, c, 1e3 * says.displacement, 1e3 * says.deviation);
        std::cout << fmt::format(
            " turn {:6.3f} {:6.3f} {:6.3f} deg shift {:6.2f} {:6.2f} {:6.2f} mm late {:6.2f} ({:.2f}) ms missed {:.2f} residual {:.2f} {}\n",
            57.3 * says.step[0], 57.3 * says.step[1], 57.3 * says.step[2], 1e3 * says.step[3], 1e3 * says.step[4], 1e3 * says.step[5], 1e3 * says.late,
            1e3 * says.late_deviation, says.missed, 1e3 * static_cast<double>(f.record->residual), alarm ? "MOVED" : "");
      }
      if (!alarm) continue;
      if (c == scene.knocked && f.time > scene.knocked_at) {
        if (out.detected < 0) out.detected = f.time - scene.knocked_at;
      } else {
        ++out.wrong;
      }
    }
    return out.detected < 0;
  });
  return out;
}

double quantile(std::vector<double> v, double q) {
  if (v.empty()) return 0;
  std::sort(v.begin(), v.end());
  return v[std::min(v.size() - 1, static_cast<std::size_t>(q * static_cast<double>(v.size())))];
}

void run(const Options& o) {
  std::vector<double> displacement, ratio;
  double followed = 0, watch_ms = 0, watch_most_ms = 0, step_ms = 0;
  int wrong = 0, frames = 0;
  std::mt19937_64 random(o.seed);
  const auto any = [&random] { return static_cast<double>(random() >> 11) / 4503599627370496.0 - 1; };
  const auto axis = [&] {
    Eigen::Vector3d v;
    do v = {any(), any(), any()};
    while (v.norm() > 1 || v.norm() < 0.1);
    return Eigen::Vector3d(v.normalized());
  };
  struct Case {
    std::string name;
    double turn = 0, shift = 0;
  };
  std::vector<Case> cases;
  for (const double d : o.degrees) cases.push_back({fmt::format("{} degrees", d), d * M_PI / 180, 0});
  for (const double c : o.centimetres) cases.push_back({fmt::format("{} cm", c), 0, c / 100});
  const bool nothing = cases.empty();
  if (nothing) cases.push_back({"none"});
  std::uint64_t seed = o.seed;
  for (const Case& k : cases) {
    std::vector<double> times;
    int runs = 0;
    for (const int body : o.bodies)
      for (const auto& motion : o.motions) {
        DriftScene scene{.body = body, .motion = motion, .seconds = o.seconds, .seed = ++seed};
        if (!nothing) {
          scene.knocked = static_cast<int>(random() % 4);
          scene.knocked_at = o.knocked_at;
          scene.knock << k.turn * axis(), k.shift * axis();
        }
        const Outcome out = watch(scene, o);
        ++runs;
        if (out.detected >= 0) times.push_back(out.detected);
        displacement.insert(displacement.end(), out.displacement.begin(), out.displacement.end());
        ratio.insert(ratio.end(), out.ratio.begin(), out.ratio.end());
        followed += out.followed;
        wrong += out.wrong;
        watch_ms += out.watch_ms;
        watch_most_ms = std::max(watch_most_ms, out.watch_most_ms);
        step_ms += out.step_ms;
        frames += out.frames;
        std::cout << fmt::format("{:<12} body {:3} {:<9} followed {:5.1f} s: others {:5.2f} mm at most, {:4.2f} deviations; {} wrong; noticed after {:.1f} s\n",
                                 k.name, body, motion, out.followed, 1e3 * quantile(out.displacement, 1), quantile(out.ratio, 1), out.wrong, out.detected)
                  << std::flush;
      }
    if (!nothing)
      std::cout << fmt::format("| {} | {} of {} | {:.1f} | {:.1f} |\n", k.name, times.size(), runs, quantile(times, 0.5), quantile(times, 1)) << std::flush;
  }
  std::cout << fmt::format(
      "cameras that stand: {:.0f} s followed, {} judgements: displacement 50 % {:.2f}, 95 % {:.2f}, 99 % {:.2f}, most {:.2f} mm; "
      "in deviations 50 % {:.2f}, 95 % {:.2f}, most {:.2f}; named wrongly in {} judgements\n",
      followed, displacement.size(), 1e3 * quantile(displacement, 0.5), 1e3 * quantile(displacement, 0.95), 1e3 * quantile(displacement, 0.99),
      1e3 * quantile(displacement, 1), quantile(ratio, 0.5), quantile(ratio, 0.95), quantile(ratio, 1), wrong);
  if (frames > 0)
    std::cout << fmt::format(
        "processor time of the watch: {:.2f} ms a frame ({:.2f} at most), {:.1f} % of what cloud, fit and watch together take ({:.1f} ms)\n", watch_ms / frames,
        watch_most_ms, 100 * watch_ms / step_ms, step_ms / frames);
}

}  // namespace
}  // namespace booth::tests

int main(int argc, char** argv) {
  CLI::App app{"The drift watch over people and motions, with cameras that stand and cameras that are knocked"};
  booth::tests::Options o;
  app.add_option("--body", o.bodies, "Set-aside bodies")->capture_default_str();
  app.add_option("--motion", o.motions, "Motions")->capture_default_str();
  app.add_option("--seconds", o.seconds, "Of each run")->capture_default_str();
  app.add_option("--at", o.knocked_at, "When the camera is knocked, seconds")->capture_default_str();
  app.add_option("--degrees", o.degrees, "Turns of one camera; without any, and without --cm, no camera is knocked");
  app.add_option("--cm", o.centimetres, "Shifts of one camera");
  app.add_option("--seed", o.seed, "Of everything")->capture_default_str();
  app.add_flag("--every", o.every, "Print every judgement");
  CLI11_PARSE(app, argc, argv);
  try {
    booth::tests::run(o);
  } catch (const std::exception& e) {
    std::cerr << e.what() << "\n";
    return 1;
  }
}
