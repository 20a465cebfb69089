// One frame's fit as any optimiser sees it: preset `paper`'s energy as a function of 51 scaled numbers, with the truth kept aside to judge by.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "daemon/pipeline/estimator_fitter.hpp"
#include "fit/energy/energy_pack.hpp"
#include "fit/swarm/backend.hpp"
#include "tests/support/allocation_count.hpp"
#include "tests/support/frame_memory.hpp"

namespace booth::bench {

using Unknowns = std::vector<double>;

/// What came of one method on one frame: every improvement, when it came, and where.
class Trace {
 public:
  struct Point {
    double seconds, energy;
    Unknowns x;
  };
  void start() { begin_ = Clock::now(); }
  double seconds() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }
  /// Remembers x where it is better than all before.
  void offer(double energy, std::span<const double> x) {
    if (points_.empty() || energy < points_.back().energy) points_.push_back({seconds(), energy, {x.begin(), x.end()}});
  }
  /// Whatever its energy: the answer of a method that was given so much time.
  void insert(double seconds, double energy, Unknowns x) { points_.push_back({seconds, energy, std::move(x)}); }
  const std::vector<Point>& points() const { return points_; }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point begin_ = Clock::now();
  std::vector<Point> points_;
};

/// Thrown out of energy() to end a method that has no other end.
struct TimeIsUp {};

/// A frame of a set-aside body in a motion that no prior was trained on, seen by four noisy cameras. The unknowns are the 36 of q and the first 15 shape
/// coefficients, each as (value - start) / deviation with preset paper's deviations; the start is where the body was 0.2 s before, with the mean shape.
/// One thread.
class Problem {
 public:
  /// The fitter's last step was on the frame; everything outlives the problem.
  Problem(const daemon::FitModels& models, const daemon::EstimatorFitter& fitter, const fit::PoseVector& before, std::vector<std::array<float, 3>> truth,
          bool woman);

  int dimensions() const { return pack_.dimensions(); }
  /// How far the boxes of bounded methods reach, in deviations.
  static constexpr double kReach = 3;

  /// Before a method runs; later energy() calls end with TimeIsUp.
  void begin(double seconds, Trace& trace);
  /// For a method that takes its memory once, then gets frame after frame, and minimises by itself: its time and its allocations count from here to there.
  void start_clock();
  void stop_clock();
  /// ... and this is its answer.
  void insert(const Unknowns& absolute);
  /// Of the frame, so far.
  std::uint64_t allocations() const { return count_ ? count_->so_far() : allocations_; }
  /// Eq. 4 at the scaled unknowns, by the back-end that preset paper uses; offered to the trace.
  double energy(std::span<const double> scaled);

  /// q and beta of scaled unknowns, and back.
  Unknowns absolute(std::span<const double> scaled) const;
  double energy_of(const Unknowns& absolute);
  /// Mean distance from each compared vertex to where it truly is, metres.
  double vertex_error(std::span<const double> absolute) const;

  const fit::BodyModel& model() const { return *model_; }
  const fit::PosePrior& prior() const { return prior_; }
  const fit::EnergyPack& pack() const { return pack_; }
  const fit::CellField& field() const { return field_; }
  const fit::Observation& observation() const { return observation_; }
  fit::SwarmBackend& swarm(int iterations);
  std::span<const float> start() const { return start_; }
  std::span<const float> deviation() const { return deviation_; }
  Trace& trace() { return *trace_; }
  double time_limit() const { return limit_; }

 private:
  const fit::BodyModel* model_;
  const fit::PosePrior& prior_;
  const fit::Observation& observation_;
  std::vector<std::array<float, 3>> truth_;
  fit::EnergyPack pack_;
  fit::WorkerPool pool_{1};
  fit::CellField field_;
  std::unique_ptr<fit::SwarmBackend> evaluator_, swarm_;
  std::vector<float> start_, deviation_, particle_;
  Trace* trace_ = nullptr;
  double limit_ = 0;
  std::optional<tests::AllocationCount> count_;
  std::uint64_t allocations_ = 0;
  double seconds_ = 0;
};

/// A method. Each library's are in a file of their own, which is built where the library is installed.
struct Method {
  const char* name;
  const char* library;  ///< "boothd" for ours
  void (*run)(Problem&);
};
void add_ours(std::vector<Method>& out);
void add_pagmo(std::vector<Method>& out);
void add_nlopt(std::vector<Method>& out);
void add_ceres(std::vector<Method>& out);

}  // namespace booth::bench
