// Checks of the pose prior's data, and what it says of angles that nothing was seen of.
#include "fit/prior/pose_prior.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace booth::fit {

void PosePrior::check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("pose prior: ") + what);
  };
  const auto b = components.cols();
  require(b >= 1 && b <= kPoseDofs, "components must be 30 x b with 1 <= b <= 30");
  require(sigma.size() == b, "sigma must have one entry for each component");
  require(mean.allFinite() && components.allFinite() && sigma.allFinite() && standard_deviation.allFinite() && lower.allFinite() && upper.allFinite() &&
              speed_limit.allFinite(),
          "a value is not finite");
  require(exemplars.cols() >= 1 && exemplars.allFinite(), "there is no exemplar pose, or one is not finite");
  require((sigma.array() > 0).all() && (standard_deviation.array() > 0).all() && (speed_limit.array() > 0).all(), "a deviation or speed is not positive");
  require((lower.array() < upper.array()).all(), "a lower limit is not below its upper limit");
  require((components.transpose() * components - Eigen::MatrixXd::Identity(b, b)).cwiseAbs().maxCoeff() < 1e-4, "components are not orthonormal");
}

namespace {

// Thighs and upper arms: round, so that their own points hardly tell how they are turned about their length.
constexpr std::array<int, 4> kLongBones{2, 7, 14, 18};
constexpr int kTurns = 24;
constexpr double kUnusualBend = 1.2;  // rad

using Precision = Eigen::Matrix<double, kPoseDofs, kPoseDofs>;

/// Sets the angles of `free` (bit k: q[k]) to the most probable ones beside the others; returns what the prior then asks for the whole pose.
double complete_angles(const PosePrior& prior, const Precision& precision, std::uint64_t free, PoseVector& q) {
  PoseAngles d = q.tail<kPoseDofs>() - prior.mean;
  const auto is_free = [&](int i) { return (free >> (kRootDofs + i) & 1u) != 0; };
  for (int i = 0; i < kPoseDofs; ++i)
    if (is_free(i)) d[i] = 0;
  // Known angles stay: their rows become x = d, and what they contribute to the others' rows goes to the right-hand side.
  Precision known = precision;
  PoseAngles right = -precision * d;
  for (int i = 0; i < kPoseDofs; ++i) {
    if (is_free(i)) continue;
    known.row(i).setZero();
    known.col(i).setZero();
    known(i, i) = 1;
    right[i] = 0;
  }
  const PoseAngles found = known.ldlt().solve(right);
  for (int i = 0; i < kPoseDofs; ++i) {
    if (!is_free(i)) continue;
    q[kRootDofs + i] = std::clamp(prior.mean[i] + found[i], prior.lower[i], prior.upper[i]);
    d[i] = q[kRootDofs + i] - prior.mean[i];
  }
  return d.dot(precision * d);
}

}  // namespace

void complete_pose(const PosePrior& prior, double outside, double inside, BoneSet unseen, PoseVector& q) {
  Precision precision = outside * Precision::Identity();
  for (Eigen::Index k = 0; k < prior.sigma.size(); ++k)
    precision.noalias() += (inside / (prior.sigma[k] * prior.sigma[k]) - outside) * prior.components.col(k) * prior.components.col(k).transpose();
  std::uint64_t moves_seen = 0, moves_unseen = 0;
  for (int b = 0; b < kBones; ++b) ((unseen >> b & 1u) != 0 ? moves_unseen : moves_seen) |= dof_mask(b);
  const std::uint64_t free = moves_unseen & ~moves_seen;

  double least = complete_angles(prior, precision, free, q);
  for (const int bone : kLongBones) {
    const Bone& next = bones()[static_cast<std::size_t>(bone) + 1];
    if ((unseen >> bone & 1u) != 0 || (unseen >> (bone + 1) & 1u) == 0 || next.parent != bone) continue;
    const PoseVector as_it_is = q;
    for (int t = 1; t < kTurns; ++t) {
      PoseVector turned = as_it_is;
      turn_about_length(bone, t * 2 * std::numbers::pi / kTurns, turned);
      const auto& dof = bones()[static_cast<std::size_t>(bone)].dof;
      if (std::any_of(dof.begin(), dof.end(), [&](int k) { return turned[k] < prior.lower[k - kRootDofs] || turned[k] > prior.upper[k - kRootDofs]; }))
        continue;
      if (const double asked = complete_angles(prior, precision, free, turned); asked < least) least = asked, q = turned;
    }
  }
}

BoneSet unusual_limbs(const PosePrior& prior, double outside, double inside, const PoseVector& q) {
  BoneSet out = 0;
  for (const int bone : kLongBones) {
    const int hinge = bones()[static_cast<std::size_t>(bone) + 1].dof[0];
    BoneSet limb = 0;
    for (int b = bone + 1; b < kBones; ++b)
      if ((dof_mask(b) >> hinge & 1u) != 0) limb |= BoneSet{1} << b;
    PoseVector usual = q;
    complete_pose(prior, outside, inside, limb, usual);
    if (std::abs(usual[hinge] - q[hinge]) > kUnusualBend) out |= limb;
  }
  return out;
}

}  // namespace booth::fit
