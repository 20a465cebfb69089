// Our presets against other people's optimisers: the same energy, the same frames, one thread each, in turns.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <memory>

#include "daemon/io/model_file.hpp"
#include "tests/bench/fit/problem.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/support/line_chart.hpp"

namespace booth::bench {
namespace {

struct Options {
  std::vector<int> bodies{3, 31, 52, 81};
  std::vector<std::string> motions{"walk", "kick", "squat"};
  double seconds = 5;
  std::string svg;
};

constexpr double kFirst = 1e-3;      ///< s, where the curves begin
constexpr int kStepsPerDecade = 24;  ///< of the curves' times
constexpr double kReached = 1.01;    ///< a method has come to its end when its error is within so much of its last

daemon::FitModels load_models() {
  const auto folder = daemon::find_models();
  return {std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "men.npz")),
          std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "women.npz")),
          std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz"))};
}

/// A frame in the middle of a motion with its cloud.
struct Frame {
  std::unique_ptr<daemon::EstimatorFitter> fitter;
  std::unique_ptr<Problem> problem;
  double start_error = 0;  ///< m
};

Frame make_frame(const daemon::FitModels& models, int body, const std::string& motion) {
  tests::SceneRequest request;
  request.body = body, request.motion = motion, request.seconds = 1;
  const tests::FrameMemory memory = tests::render_frames(request);
  const std::size_t k = memory.frames[0].size() / 2;
  daemon::FitInput input;
  hal::Nanoseconds sum{};
  for (std::size_t c = 0; c < memory.frames.size(); ++c) {
    input.frames[c] = &memory.frames[c][k];
    sum += memory.frames[c][k].captured.time_since_epoch();
  }
  input.reference = hal::MonotonicTime(sum / static_cast<int>(memory.frames.size()));
  Frame frame;
  frame.fitter = std::make_unique<daemon::EstimatorFitter>(memory.cameras, memory.background, models, fit::CloudSettings{}, fit::EstimatorSettings{});
  daemon::FrameRecord record;
  frame.fitter->step(input, record);
  const auto before = memory.truth->at(input.reference - hal::from_seconds(0.2));
  if (!before) throw std::runtime_error("the truth of the frame is not known");
  const fit::PoseVector q = Eigen::Map<const fit::PoseVector>(before->q.data());
  frame.problem = std::make_unique<Problem>(models, *frame.fitter, q, memory.truth->surface(input.reference), memory.truth->sex() == "women");
  frame.start_error = frame.problem->vertex_error(frame.problem->absolute(Unknowns(static_cast<std::size_t>(frame.problem->dimensions()), 0.0)));
  return frame;
}

/// What a method has reached by each of the curve's times, over all frames.
struct Course {
  std::string name;
  std::vector<double> error_cm, energy;
  double allocations = 0;  ///< a frame
  double last_error() const { return error_cm.back(); }
};

std::vector<double> curve_times(double limit) {
  std::vector<double> out;
  for (int i = 0;; ++i) {
    out.push_back(kFirst * std::pow(10.0, static_cast<double>(i) / kStepsPerDecade));
    if (out.back() >= limit) return out;
  }
}

Course follow(const Method& method, std::vector<Frame>& frames, const std::vector<double>& times, double limit) {
  Course course{fmt::format("{} {}", method.library, method.name), std::vector<double>(times.size()), std::vector<double>(times.size()), 0};
  for (Frame& frame : frames) {
    Problem& problem = *frame.problem;
    const double start_energy = problem.energy_of(problem.absolute(Unknowns(static_cast<std::size_t>(problem.dimensions()), 0.0)));
    Trace trace;
    problem.begin(limit, trace);
    method.run(problem);
    course.allocations += static_cast<double>(problem.allocations()) / static_cast<double>(frames.size());
    std::size_t next = 0;
    double error = frame.start_error, energy = start_energy;
    for (std::size_t t = 0; t < times.size(); ++t) {
      bool moved = false;
      for (; next < trace.points().size() && trace.points()[next].seconds <= times[t]; ++next) moved = true;
      if (moved) error = problem.vertex_error(trace.points()[next - 1].x), energy = trace.points()[next - 1].energy;
      course.error_cm[t] += 100 * error / static_cast<double>(frames.size());
      course.energy[t] += energy / static_cast<double>(frames.size());
    }
  }
  return course;
}

/// The first of the curve's times by which a mean error was reached; infinity when never.
double time_to(const Course& course, const std::vector<double>& times, double error_cm) {
  for (std::size_t t = 0; t < times.size(); ++t)
    if (course.error_cm[t] <= error_cm) return times[t];
  return std::numeric_limits<double>::infinity();
}

std::string picture_of(const std::vector<Course>& courses, const std::vector<double>& times) {
  tests::LineChart chart;
  chart.title = "Error against time: the same energy, the same frames, one thread";
  chart.x_label = "seconds a frame", chart.y_label = "mean distance of vertices from the truth, cm";
  chart.log_x = true;
  for (const Course& c : courses) chart.lines.push_back({c.name, times, c.error_cm});
  return tests::to_svg(chart);
}

void run(Options o, const Common& common, Report& report) {
  if (common.short_form) o.bodies = {3}, o.motions = {"kick"}, o.seconds = std::min(o.seconds, 0.5);
  std::ofstream svg;
  if (!o.svg.empty()) svg.open(o.svg);  // now: minutes of measuring would be lost on a folder that does not exist
  if (!svg) throw std::runtime_error("--svg " + o.svg + " cannot be written");
  std::vector<Method> methods;
  add_ours(methods);
#ifdef BOOTHD_PEER_PAGMO
  add_pagmo(methods);
#endif
#ifdef BOOTHD_PEER_NLOPT
  add_nlopt(methods);
#endif
#ifdef BOOTHD_PEER_CERES
  add_ceres(methods);
#endif
  const daemon::FitModels models = load_models();
  std::vector<Frame> frames;
  for (const std::string& motion : o.motions)
    for (const int body : o.bodies) {
      std::cerr << "fit: rendering body test:" << body << ", " << motion << "\n";
      frames.push_back(make_frame(models, body, motion));
    }
  double start_error = 0;
  for (const Frame& f : frames) start_error += 100 * f.start_error / static_cast<double>(frames.size());
  const std::vector<double> times = curve_times(o.seconds);
  std::vector<Course> courses;
  const Course* peer = nullptr;
  for (const Method& method : methods) {
    std::cerr << "fit: " << method.library << " " << method.name << "\n";
    courses.push_back(follow(method, frames, times, o.seconds));
  }
  for (std::size_t i = 0; i < courses.size(); ++i)
    if (std::string(methods[i].library) != "boothd" && (peer == nullptr || courses[i].last_error() < peer->last_error())) peer = &courses[i];
  const double peer_error = peer != nullptr ? peer->last_error() : 0;
  const double peer_time = peer != nullptr ? time_to(*peer, times, kReached * peer_error) : 0;

  report.note("frames", fmt::format("{}, of {} set-aside bodies, from where they were 0.2 s before", frames.size(), o.bodies.size()));
  report.note("most time a frame and method", fmt::format("{:g} s", o.seconds));
  if (peer == nullptr) report.note("peers", "none: install libpagmo-dev, libnlopt-cxx-dev or libceres-dev and configure anew");
  for (const Course& c : courses) {
    report.add({c.name + ": error at its end", "cm", c.last_error(), "at the start", start_error});
    if (peer != nullptr) report.add({c.name + ": error at its end", "cm", c.last_error(), "best peer: " + peer->name, peer_error});
    report.add({c.name + ": time until within 1 % of it", "ms", 1e3 * time_to(c, times, kReached * c.last_error()), peer != nullptr ? "best peer" : "",
                1e3 * peer_time});
    if (const double t = time_to(c, times, peer_error); peer != nullptr && &c != peer && std::isfinite(t))
      report.add({c.name + ": time to the best peer's error", "ms", 1e3 * t, "best peer", 1e3 * peer_time});
    report.add({c.name + ": eq. 4 at its end", "", c.energy.back()});
    report.add({c.name + ": allocations a frame", "", c.allocations});
  }
  if (o.svg.empty()) return;
  svg << picture_of(courses, times);
  if (!svg.flush()) throw std::runtime_error("--svg " + o.svg + " cannot be written");
}

Run make(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option("--bodies", o->bodies, "Set-aside bodies, 1 to 90")->check(CLI::Range(1, 90))->capture_default_str();
  app.add_option("--motions", o->motions, "Motions")->capture_default_str();
  app.add_option("--seconds", o->seconds, "Most time for a method and frame")->check(CLI::Range(0.01, 600.0))->capture_default_str();
  app.add_option("--svg", o->svg, "Draw error against time into this file");
  return [o](const Common& common, Report& report) { run(*o, common, report); };
}

const Registration registration({"fit", "Presets booth and paper against pagmo, nlopt and Ceres: error against time on the same energy and frames", make});

}  // namespace
}  // namespace booth::bench
