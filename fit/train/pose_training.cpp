// Moments, percentiles and k-means++ medoids over the frames and their mirror images.
#include "fit/train/pose_training.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "fit/train/random.hpp"

namespace booth::fit::train {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kWidening = 12 * kDegree;
constexpr double kLeastDeviation = 0.5 * kDegree;  // an angle that never moves still may, a little

/// Reach that the limits never fall short of, left side and middle, degrees. The motions lack some of it (arms straight up, deep squats).
struct Reach {
  std::string_view dof;
  double low, high;
};
constexpr Reach kReach[] = {{"ltibia_rx", -5, 150},     {"lradius_rx", -5, 150},   {"lfemur_rx", -125, 35},   {"lfemur_ry", -45, 45}, {"lfemur_rz", -60, 25},
                            {"lhumerus_rx", -110, 110}, {"lhumerus_ry", -85, 70},  {"lhumerus_rz", -95, 130}, {"lfoot_rx", -45, 45},  {"upperback_rx", -40, 70},
                            {"upperback_ry", -45, 45},  {"upperback_rz", -35, 35}, {"neck_rx", -50, 50},      {"neck_rz", -40, 40},   {"head_ry", -80, 80}};

/// Poses that a search should know and the motions hardly hold; symmetric, degrees of the left side and the middle.
struct WrittenPose {
  double pitch;  ///< root_rx
  double lift;   ///< metres between the lowest joint and where on_the_floor() puts it: half a body's thickness when lying
  double upperback, humerus_rz, elbow, femur_rx, femur_rz, knee, foot;
};
constexpr WrittenPose kWrittenPoses[] = {
    {0, 0, 0, 45, 0, 0, -13, 0, 0},            // A
    {0, 0, 0, 0, 0, 0, -15, 0, 0},             // T
    {0, 0, 0, -80, 10, 0, -18, 0, 0},          // arms straight up
    {25, 0, 20, 60, 40, -115, -35, 130, -35},  // deep squat
    {0, 0, 0, 70, 70, -90, -20, 90, 0},        // sitting
    {0, 0, 0, 75, 20, -5, -20, 95, 35},        // kneeling
    {-90, 0.08, 0, 70, 15, 0, -15, 0, 20},     // lying on the back
    {90, 0.08, 0, 70, 15, 0, -15, 0, 40},      // lying on the front
};

PoseVector written(const WrittenPose& p) {
  PoseVector q = PoseVector::Zero(), left = q;
  left[13] = p.humerus_rz, left[14] = p.elbow, left[24] = p.femur_rx, left[26] = p.femur_rz, left[27] = p.knee, left[28] = p.foot;
  q = left + mirror(left);
  q[3] = p.pitch, q[6] = p.upperback;
  q = on_the_floor(q * kDegree);
  q[1] += p.lift;
  return q;
}

double percentile(std::vector<double>& values, double part) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

using Poses = std::vector<PoseVector>;
using Shape = Eigen::Matrix<float, 3 * kJoints, 1>;

/// Without heading and horizontal place.
PoseVector canonical(PoseVector q) {
  q[0] = q[2] = q[4] = 0;
  return q;
}

Shape joints_of(const PoseVector& q) {
  Kinematics kin;
  forward_kinematics(q, average_bone_vectors(), kin);
  return kin.joint.cast<float>().reshaped();
}

/// Indices of the frames nearest to the centres of k clusters of joint positions.
std::vector<int> medoids(const Poses& poses, int k, std::uint64_t seed) {
  const Eigen::Index n = static_cast<Eigen::Index>(poses.size());
  k = static_cast<int>(std::min<Eigen::Index>(k, n));
  Eigen::MatrixXf points(3 * kJoints, n);
  for (Eigen::Index i = 0; i < n; ++i) points.col(i) = joints_of(poses[static_cast<std::size_t>(i)]);
  Random random(seed, 21);
  Eigen::MatrixXf centre(points.rows(), k);
  centre.col(0) = points.col(static_cast<Eigen::Index>(random.uniform() * static_cast<double>(n)));
  Eigen::VectorXf distance = (points.colwise() - centre.col(0)).colwise().squaredNorm();
  for (int c = 1; c < k; ++c) {  // k-means++: far points are likelier, so that rare poses get a centre of their own
    double target = random.uniform() * distance.cast<double>().sum();
    Eigen::Index pick = 0;
    while (pick + 1 < n && (target -= static_cast<double>(distance[pick])) > 0) ++pick;
    centre.col(c) = points.col(pick);
    distance = distance.cwiseMin((points.colwise() - centre.col(c)).colwise().squaredNorm().transpose());
  }
  std::vector<int> owner(static_cast<std::size_t>(n), -1), nearest(static_cast<std::size_t>(k), -1);
  for (int round = 0; round < 12; ++round) {
    const Eigen::VectorXf norms = centre.colwise().squaredNorm();
    Eigen::MatrixXf sum = Eigen::MatrixXf::Zero(points.rows(), k);
    std::vector<int> members(static_cast<std::size_t>(k), 0);
    std::vector<float> best(static_cast<std::size_t>(k), 1e30f);
    for (Eigen::Index i = 0; i < n; ++i) {
      Eigen::Index c = 0;
      const float d = (norms - 2 * (centre.transpose() * points.col(i))).minCoeff(&c) + points.col(i).squaredNorm();
      sum.col(c) += points.col(i);
      ++members[static_cast<std::size_t>(c)];
      if (d < best[static_cast<std::size_t>(c)]) best[static_cast<std::size_t>(c)] = d, nearest[static_cast<std::size_t>(c)] = static_cast<int>(i);
    }
    for (int c = 0; c < k; ++c)
      if (members[static_cast<std::size_t>(c)] > 0) centre.col(c) = sum.col(c) / static_cast<float>(members[static_cast<std::size_t>(c)]);
  }
  std::erase(nearest, -1);
  return nearest;
}

bool standing(const PoseVector& q) {
  return q[1] > 0.85 && std::abs(q[3]) < 0.35 && std::abs(q[5]) < 0.35 && std::abs(q[6]) < 0.5 && q[27] < 0.6 && q[33] < 0.6;
}

}  // namespace

PoseVector on_the_floor(PoseVector q) {
  Kinematics kin;
  q[1] = 0;
  forward_kinematics(q, average_bone_vectors(), kin);
  q[1] = 0.02 - kin.joint.row(1).minCoeff();
  return q;
}

PosePrior train_pose_prior(const Eigen::MatrixXf& frames, const std::vector<MotionSegment>& segments, const PoseTrainingSettings& settings) {
  Poses poses;  // thinned; mirror images follow below
  std::array<std::vector<double>, kDofs> speeds;
  for (const auto& s : segments) {
    if (s.start < 0 || s.frames < 1 || s.stride < 1 || s.start + s.frames > frames.cols())
      throw std::invalid_argument("pose training: a segment lies outside the sequence");
    for (int f = s.start; f < s.start + s.frames; ++f) {
      const PoseVector q = frames.col(f).cast<double>();
      if (!q.allFinite()) throw std::invalid_argument("pose training: frame " + std::to_string(f) + " is not finite");
      if ((f - s.start) % s.stride == 0) poses.push_back(canonical(q));
      if (f == s.start) continue;
      const PoseVector step = (q - frames.col(f - 1).cast<double>()).cwiseAbs() * 30, other = mirror(step).cwiseAbs();
      for (int d = 0; d < kDofs; ++d) speeds[static_cast<std::size_t>(d)].insert(speeds[static_cast<std::size_t>(d)].end(), {step[d], other[d]});
    }
  }
  if (poses.size() < 1000) throw std::invalid_argument("pose training: " + std::to_string(poses.size()) + " frames are too few; at least 1000 are needed");
  const std::size_t originals = poses.size();
  Poses both = poses;
  for (const auto& q : poses) both.push_back(mirror(q));

  PosePrior prior;
  const double n = static_cast<double>(both.size());
  prior.mean.setZero();
  for (const auto& q : both) prior.mean += q.tail<kPoseDofs>() / n;
  Eigen::Matrix<double, kPoseDofs, kPoseDofs> covariance = decltype(covariance)::Zero();
  for (const auto& q : both) {
    const PoseAngles d = q.tail<kPoseDofs>() - prior.mean;
    covariance += d * d.transpose() / n;
  }
  prior.standard_deviation = covariance.diagonal().cwiseSqrt().cwiseMax(kLeastDeviation);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const Eigen::VectorXd variance = solver.eigenvalues().reverse().cwiseMax(0);
  const Eigen::MatrixXd direction = solver.eigenvectors().rowwise().reverse();
  Eigen::Index kept = 0;
  for (double sum = 0; sum < settings.kept_variance * variance.sum(); ++kept) sum += variance[kept];
  prior.components = direction.leftCols(kept);
  for (Eigen::Index k = 0; k < kept; ++k) {
    Eigen::Index largest = 0;
    prior.components.col(k).cwiseAbs().maxCoeff(&largest);
    if (prior.components(largest, k) < 0) prior.components.col(k) *= -1;
  }
  prior.sigma = variance.head(kept).cwiseSqrt();

  for (int d = kRootDofs; d < kDofs; ++d) {
    std::vector<double> values;
    values.reserve(both.size());
    for (const auto& q : both) values.push_back(q[d]);
    prior.lower[d - kRootDofs] = percentile(values, 0.01) - kWidening;
    prior.upper[d - kRootDofs] = percentile(values, 0.99) + kWidening;
  }
  for (const auto& reach : kReach) {
    const int d = dof_index(reach.dof);
    PoseVector low = PoseVector::Zero(), high = PoseVector::Zero();
    low[d] = reach.low * kDegree, high[d] = reach.high * kDegree;
    const PoseVector low_right = mirror(low), high_right = mirror(high);
    for (const auto& [a, b] : {std::pair{low, high}, std::pair{low_right, high_right}})
      for (int i = kRootDofs; i < kDofs; ++i) {
        prior.lower[i - kRootDofs] = std::min({prior.lower[i - kRootDofs], a[i], b[i]});
        prior.upper[i - kRootDofs] = std::max({prior.upper[i - kRootDofs], a[i], b[i]});
      }
  }
  for (int d = 0; d < kDofs; ++d) prior.speed_limit[d] = std::max(settings.speed_margin * percentile(speeds[static_cast<std::size_t>(d)], 0.99), 0.1);

  // Exemplars: every fourth pose is enough to place cluster centres.
  Poses some, upright;
  for (std::size_t i = 0; i < originals; i += 4) {
    some.push_back(poses[i]);
    if (standing(poses[i])) upright.push_back(poses[i]);
  }
  Poses chosen;
  const auto add = [&](const PoseVector& q) {
    chosen.push_back(q);
    chosen.push_back(mirror(q));
  };
  for (int i : medoids(upright, settings.standing_clusters, settings.seed)) add(upright[static_cast<std::size_t>(i)]);
  for (int i : medoids(some, settings.clusters, settings.seed + 1)) add(some[static_cast<std::size_t>(i)]);
  for (const auto& pose : kWrittenPoses) chosen.push_back(written(pose));
  prior.exemplars.resize(kDofs, static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    // As the file will hold them.
    prior.exemplars.col(static_cast<Eigen::Index>(i)) = chosen[i].cast<float>().cast<double>();
  }
  prior.check();
  return prior;
}

}  // namespace booth::fit::train
