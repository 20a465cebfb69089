// Rules for the joints of the base body, and non-negative least squares over growing neighbourhoods for any body.
#include "fit/train/joints.hpp"

#include <algorithm>
#include <flann/flann.hpp>
#include <map>
#include <stdexcept>

#include "fit/train/nnls.hpp"

namespace booth::fit::train {
namespace {

using Row = std::map<int, double>;

class PointRules {
 public:
  explicit PointRules(const BaseBody& base) : base_(base) {}
  Row cube(const std::string& name) const {
    const auto found = base_.points.find("joint-" + name);
    if (found == base_.points.end()) throw std::invalid_argument("the base body has no point joint-" + name);
    Row row;
    for (int v : found->second) row[v] += 1.0 / static_cast<double>(found->second.size());
    return row;
  }

 private:
  const BaseBody& base_;
};

/// a + t (b - a)
Row between(const Row& a, const Row& b, double t) {
  Row row;
  for (const auto& [v, w] : a) row[v] += (1 - t) * w;
  for (const auto& [v, w] : b) row[v] += t * w;
  return row;
}

// Fractions that put our points where the CMU average skeleton has them on an average body.
constexpr double kRootAboveHips = 1.095;  // of the way from the hips' middle to spine-4
constexpr double kSpinePivot = 0.1457;    // of the way from the root to the chest top: 5.1 of 34.9 cm
constexpr double kChestTop = 0.5;         // between spine-1 and neck: level of the collar bones' inner ends
constexpr double kNeckPivot = 0.251;      // of the way from the chest top to the head base: 4.8 of 19.0 cm
constexpr double kToeEnd = 0.6;           // of the way from the toes' base to the point before the toes: 5 cm
constexpr double kHeadTop = 0.85;         // of the way from the head's base to the point above the crown: 2 cm below the skin
constexpr double kHandStub = 1.0 / 3;     // of the way from the wrist to the middle knuckle: 3.7 cm

}  // namespace

std::vector<SparseRow> joint_rows(const BaseBody& base) {
  const PointRules rules(base);
  std::map<std::string, Row, std::less<>> joint;
  for (const std::string side : {"l", "r"}) {
    joint[side + "hip"] = rules.cube(side + "-upper-leg");
    joint[side + "knee"] = rules.cube(side + "-knee");
    joint[side + "ankle"] = rules.cube(side + "-ankle");
    joint[side + "foot_end"] = rules.cube(side + "-foot-1");
    joint[side + "toe_end"] = between(rules.cube(side + "-foot-1"), rules.cube(side + "-foot-2"), kToeEnd);
    joint[side + "shoulder"] = rules.cube(side + "-shoulder");
    joint[side + "elbow"] = rules.cube(side + "-elbow");
    joint[side + "wrist"] = rules.cube(side + "-hand");
    joint[side + "hand_end"] = between(rules.cube(side + "-hand"), rules.cube(side + "-finger-3-1"), kHandStub);
  }
  joint["root"] = between(between(joint["lhip"], joint["rhip"], 0.5), rules.cube("spine-4"), kRootAboveHips);
  joint["chest_top"] = between(rules.cube("spine-1"), rules.cube("neck"), kChestTop);
  joint["spine_pivot"] = between(joint["root"], joint["chest_top"], kSpinePivot);
  joint["head_base"] = rules.cube("head");
  joint["head_top"] = between(rules.cube("head"), rules.cube("head-2"), kHeadTop);
  joint["neck_pivot"] = between(joint["chest_top"], joint["head_base"], kNeckPivot);

  std::vector<SparseRow> rows;
  for (const auto& bone : bones()) {
    const auto found = joint.find(bone.end_joint);
    if (found == joint.end()) throw std::invalid_argument("no rule places the joint " + std::string(bone.end_joint));
    SparseRow row;
    for (const auto& [v, w] : found->second) row.emplace_back(v, static_cast<float>(w));
    rows.push_back(row);
  }
  return rows;
}

namespace {

constexpr std::size_t kMostNeighbours = 768;
// Over all bodies a wider ring pays, because weights that must not be negative balance a fuller front by a fuller back: all of the nearest,
// every other one of a wider neighbourhood (about 40 cm).
constexpr std::size_t kDenseRing = 256, kWideRing = 2000;

/// Normal equations of sum_l w_l (v_l - J) = 0 with a heavy sum_l w_l = 1; solved and normalised.
Eigen::VectorXd solve_row(Eigen::MatrixXd gram) {
  const double weight = 100 * gram.diagonal().mean() + 1e-12;
  gram.diagonal().array() += 1e-9 * weight;  // the smallest weights among equals
  gram.array() += weight;
  Eigen::VectorXd w = solve_nnls(gram, Eigen::VectorXd::Constant(gram.rows(), weight));
  return w / w.sum();
}

}  // namespace

Eigen::MatrixXd train_joint_regressor(const RegressorInput& input) {
  const int count = static_cast<int>(input.mean.cols());
  Eigen::MatrixXd regressor = Eigen::MatrixXd::Zero(kJoints, count);
  std::vector<float> points(input.mean.data(), input.mean.data() + input.mean.size());
  flann::Index<flann::L2<float>> index(flann::Matrix<float>(points.data(), static_cast<std::size_t>(count), 3), flann::KDTreeSingleIndexParams());
  index.buildIndex();

  for (int joint = 0; joint < kJoints; ++joint) {
    if (mirror_bone(joint) < joint) continue;  // the right side is the left one's mirror image
    const Eigen::Vector3d target = input.mean_joints.col(joint);
    Eigen::Vector3f query = target.cast<float>();
    std::vector<int> near;
    Eigen::VectorXd w;
    for (std::size_t k = 24;; k *= 2) {
      k = std::min(k, static_cast<std::size_t>(count));
      std::vector<std::size_t> found(k);
      std::vector<float> distance(k);
      flann::Matrix<std::size_t> found_rows(found.data(), 1, k);
      flann::Matrix<float> distance_rows(distance.data(), 1, k);
      index.knnSearch(flann::Matrix<float>(query.data(), 1, 3), found_rows, distance_rows, k, flann::SearchParams(flann::FLANN_CHECKS_UNLIMITED));
      near.assign(found.begin(), found.end());
      Eigen::Matrix3Xd offset(3, static_cast<Eigen::Index>(k));
      for (std::size_t i = 0; i < k; ++i) offset.col(static_cast<Eigen::Index>(i)) = input.mean.col(near[i]).cast<double>() - target;
      w = solve_row(offset.transpose() * offset);
      if ((offset * w).norm() < 1e-3 || k >= kMostNeighbours || k == static_cast<std::size_t>(count)) {
        if (!input.bodies) break;
        const std::size_t wide = std::min(kWideRing, static_cast<std::size_t>(count));
        found.resize(wide);
        distance.resize(wide);
        flann::Matrix<std::size_t> wide_rows(found.data(), 1, wide);
        flann::Matrix<float> wide_distance(distance.data(), 1, wide);
        index.knnSearch(flann::Matrix<float>(query.data(), 1, 3), wide_rows, wide_distance, wide, flann::SearchParams(flann::FLANN_CHECKS_UNLIMITED));
        near.clear();
        for (std::size_t i = 0; i < wide; i += i < kDenseRing ? 1 : 2) near.push_back(static_cast<int>(found[i]));
        break;
      }
    }
    if (input.bodies) {
      const auto& bodies = *input.bodies;
      const Eigen::Index k = static_cast<Eigen::Index>(near.size());
      Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(k, k);
      constexpr Eigen::Index kBatch = 64;  // bodies whose rows are summed at once
      for (Eigen::Index first = 0; first < bodies.cols(); first += kBatch) {
        const Eigen::Index batch = std::min(kBatch, bodies.cols() - first);
        Eigen::MatrixXd rows(3 * batch, k);
        for (Eigen::Index b = 0; b < batch; ++b) {
          const auto body = bodies.col(first + b);
          const Eigen::Vector3d j = body.segment<3>(3 * (count + joint)).cast<double>();
          for (Eigen::Index i = 0; i < k; ++i) rows.col(i).segment<3>(3 * b) = body.segment<3>(3 * near[static_cast<std::size_t>(i)]).cast<double>() - j;
        }
        gram.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
      }
      w = solve_row(Eigen::MatrixXd(gram.selfadjointView<Eigen::Lower>()) / static_cast<double>(bodies.cols()));
    }
    const int partner = mirror_bone(joint);
    for (Eigen::Index i = 0; i < w.size(); ++i) {
      const int v = near[static_cast<std::size_t>(i)], m = input.mirror_vertex[v];
      if (partner == joint) {
        regressor(joint, v) += w[i] / 2;
        regressor(joint, m) += w[i] / 2;
      } else {
        regressor(joint, v) = w[i];
        regressor(partner, m) = w[i];
      }
    }
  }
  return regressor;
}

}  // namespace booth::fit::train
