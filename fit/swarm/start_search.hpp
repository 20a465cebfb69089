// Finds the basin: compares the cloud with typical poses turned every way a person may stand or lie and hands on the few that are worth refining.
#pragma once

#include <array>
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

/// A swarm without velocities: every exemplar of the pose prior at kHeadings headings; where the cloud is long and not upright, also lying along its
/// longest axis, head at either end, at kRolls turns about that axis. The work is bounded by these numbers. All buffers are taken in the constructor.
/// Deterministic for any number of threads.
class StartSearch {
 public:
  static constexpr int kHeadings = 12;
  static constexpr int kRolls = 8;
  static constexpr int kGlance = 64;        ///< vertices and cloud points that every whole pose is judged by; the best are judged again by kSamples
  static constexpr int kSamples = 128;      ///< of both
  static constexpr int kLimbSamples = 256;  ///< and a limb, which is a small part of them
  static constexpr int kMostCandidates = 80;

  StartSearch(const BodyModel& model, const PosePrior& prior, WorkerPool& pool);

  /// The shape that the candidates have (the mean body's at first; the known body's for re-acquisition).
  void set_shape(const ShapeVector& beta);

  /// Fills `out` with at most `count` (kMostCandidates) clearly different candidates, best first; `out` keeps its capacity. Empty for a cloud of fewer
  /// than 50 points. `from_top`: upright poses whose highest point is the cloud's, for a cloud that lacks the legs.
  void search(const Observation& observation, int count, std::vector<StartCandidate>& out, bool from_top = false);

  /// Ways out when a limb was lost although the trunk is right: pose q with one arm or leg at the angles of an exemplar, or (`forearms`) with one
  /// forearm pointing another way; the kPerLimb that explain the cloud best for each limb, if they are clearly another pose and not clearly worse. Fills `out`
  /// from the front; returns how many.
  static constexpr int kPerLimb = 4, kLimbs = 4;
  int propose_limbs(const Observation& observation, const ShapeVector& beta, const PoseVector& q, bool forearms, std::span<PoseVector, kLimbs * kPerLimb> out);

  std::size_t memory_bytes() const;

 private:
  struct Sample {  // structure of arrays
    explicit Sample(int capacity);
    std::vector<float> x, y, z, nx, ny, nz;
  };
  /// How a body stands in the room: its root's angles q[3..5] and what they do to a point.
  struct Turn {
    std::array<double, 3> angles;
    std::array<float, 9> matrix;
    bool upright;  ///< the exemplar's own lean comes before
  };
  static Turn turned(double rx, double ry, double rz, bool upright);
  /// Upright turns, and those of a body that lies along the cloud.
  void list_turns();
  /// Puts an exemplar on the ground, its middle at the cloud's; returns where the root is.
  Eigen::Vector3f place(int exemplar, const Turn& turn, Sample& out) const;
  PoseVector pose_of(int candidate) const;
  using LimbPose = Eigen::Matrix<double, 6, 1>;
  void list_limb_poses(int limb, const PoseVector& q, bool forearms);
  static float score(const Sample& cloud, int cloud_count, const float* x, const float* y, const float* z, const float* nx, const float* ny, const float* nz,
                     int count);
  static float score(const Sample& cloud, int cloud_count, const Sample& body, int count);
  static int sample_cloud(const Cloud& cloud, int most, Sample& out);
  void judge(int begin, int end, const Sample& cloud, int cloud_count, int count);

  const PosePrior& prior_;
  WorkerPool& pool_;
  Poser poser_, limb_poser_;
  ShapeVector limb_shape_;
  int samples_, limb_samples_;
  std::vector<Sample> leaning_, straight_;  ///< each exemplar with its own lean, and with the trunk's axis along y; root at the origin
  Sample cloud_, glance_;
  int cloud_samples_ = 0, glance_samples_ = 0;
  Eigen::Vector3f middle_ = Eigen::Vector3f::Zero();  ///< of the cloud
  float ground_ = 0, top_ = 0;
  bool from_top_ = false;
  std::vector<Turn> turns_;
  std::vector<std::pair<float, int>> candidates_;     ///< cost, and exemplar * kMostTurns + turn
  std::array<std::vector<int>, kLimbs> limb_choice_;  ///< exemplars whose limb differs from the others'
  std::vector<LimbPose> limb_poses_;                  ///< that one limb is tried in
  std::vector<std::pair<float, int>> limb_order_;     ///< cost and index into them
  std::vector<Sample> chosen_, work_;                 ///< accepted candidates; one scratch sample for each task
  static constexpr int kMostTurns = kHeadings + 2 * kRolls;
};

}  // namespace booth::fit
