// Finds the basin: compares the cloud with typical poses seen from every heading and hands on the few that are worth refining.
#pragma once

#include <span>
#include <utility>
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
  static constexpr int kHeadings = 12;
  static constexpr int kSamples = 128;      ///< vertices and cloud points that a whole pose is judged by
  static constexpr int kLimbSamples = 256;  ///< and a limb, which is a small part of them

  StartSearch(const BodyModel& model, const PosePrior& prior, WorkerPool& pool);

  /// The shape that the candidates have (the mean body's at first; the known body's for re-acquisition).
  void set_shape(const ShapeVector& beta);

  /// Fills `out` with at most `count` clearly different candidates, best first; `out` keeps its capacity. Empty for a cloud of fewer than 50 points.
  void search(const Observation& observation, int count, std::vector<StartCandidate>& out);

  /// Ways out when a limb was lost although the trunk is right: pose q with one arm or leg at the angles of an exemplar, the kPerLimb that explain
  /// the cloud best for each limb, if they are clearly another pose and not clearly worse. Fills `out` from the front; returns how many.
  static constexpr int kPerLimb = 4, kLimbs = 4;
  int propose_limbs(const Observation& observation, const ShapeVector& beta, const PoseVector& q, std::span<PoseVector, kLimbs * kPerLimb> out);

 private:
  struct Sample {  // structure of arrays, kLimbSamples long
    std::vector<float> x, y, z, nx, ny, nz;
  };
  float score(const Sample& body) const;
  float score(const std::vector<float>& x, const std::vector<float>& y, const std::vector<float>& z, const std::vector<float>& nx, const std::vector<float>& ny,
              const std::vector<float>& nz, int count) const;
  void sample_cloud(const Cloud& cloud, int most);

  const PosePrior& prior_;
  WorkerPool& pool_;
  Poser poser_, limb_poser_;
  ShapeVector limb_shape_;
  int samples_, limb_samples_;
  std::vector<Sample> exemplar_;         ///< each exemplar posed at heading zero, horizontal centre of its samples at the origin
  std::vector<Eigen::Vector2f> centre_;  ///< (x, z) of the samples' centre from the root
  std::vector<float> low_;               ///< lowest sample, m
  Sample cloud_;
  int cloud_samples_ = 0;
  std::vector<StartCandidate> candidates_;
  std::vector<int> order_;
  std::vector<std::pair<float, int>> limb_order_;  ///< cost and exemplar
  std::vector<Sample> chosen_, work_;              ///< accepted candidates; one scratch sample for each task
};

}  // namespace booth::fit
