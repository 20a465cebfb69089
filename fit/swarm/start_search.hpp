// Finds the basin: compares the cloud with typical poses seen from every heading and hands on the few that are worth refining.
#pragma once

#include <vector>

#include "fit/body/poser.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/parallel.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::fit {

struct StartCandidate {
  PoseVector q;
  float cost;  ///< robust two-sided mean squared distance, m^2; lower is better
};

/// A swarm without velocities: every exemplar of the pose prior at kHeadings headings. All buffers are taken in the constructor.
/// Deterministic for any number of threads.
class StartSearch {
 public:
  static constexpr int kHeadings = 12, kSamples = 128;

  StartSearch(const BodyModel& model, const PosePrior& prior, WorkerPool& pool);

  /// The shape that the candidates have (the mean body's at first; the known body's for re-acquisition).
  void set_shape(const ShapeVector& beta);

  /// Fills `out` with at most `count` clearly different candidates, best first; `out` keeps its capacity. Empty for a cloud of fewer than 50 points.
  void search(const Observation& observation, int count, std::vector<StartCandidate>& out);

 private:
  struct Sample {  // structure of arrays, kSamples long
    std::vector<float> x, y, z, nx, ny, nz;
  };
  float score(const Sample& body) const;

  const PosePrior& prior_;
  WorkerPool& pool_;
  Poser poser_;
  int samples_;
  std::vector<Sample> exemplar_;        ///< each exemplar posed at heading zero, horizontal centre of its samples at the origin
  std::vector<Eigen::Vector2f> centre_; ///< (x, z) of the samples' centre from the root
  std::vector<float> low_;              ///< lowest sample, m
  Sample cloud_;
  int cloud_samples_ = 0;
  std::vector<StartCandidate> candidates_;
  std::vector<int> order_;
  std::vector<Sample> chosen_, work_;   ///< accepted candidates; one scratch sample for each task
};

}  // namespace booth::fit
