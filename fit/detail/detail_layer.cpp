// Correspondences on the surface as it is now, one row per point, one sparse solve; and again.
#include "fit/detail/detail_layer.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "fit/estimator.hpp"

namespace booth::fit {
namespace {

constexpr float kNormalGate = 0.1f;     // cosine between a point's normal and a vertex's: cloth turns more than skin
constexpr float kSteep = 0.3f;          // cosine between the surface's normal and an offset's way; less tells nothing of the offset
constexpr double kLongestGap = 0.1;     // s; moments further apart give no velocity
constexpr int kDistancePoints = 20000;  // for figures
constexpr float kFar = 0.5f;            // m; a point further away counts as this

}  // namespace

DetailLayer::DetailLayer(const BodyModel& model, DetailSettings settings)
    : model_(model), settings_(settings), system_(model.data().faces, model.vertex_count()), surface_(model.data().faces, model.vertex_count()) {
  const int n = model.vertex_count();
  offsets_.setZero(n);
  for (Vertices* v : {&rest_, &rest_normals_, &base_, &way_, &posed_, &normals_, &before_, &velocity_}) v->setZero(3, n);
  surface_.set(posed_, normals_);
}

void DetailLayer::reset() {
  system_.reset();
  offsets_.setZero();
  moments_ = 0;
  moving_ = false;
}

void DetailLayer::place(const ShapeVector& beta, const PoseVector& q) {
  model_.shaped(beta, rest_);
  vertex_normals(rest_, model_.data().faces, rest_normals_);
  const Points3 joints = model_.rest_joints(beta);
  model_.pose_mesh(rest_, joints, q, base_);
  // Skinning is affine in the resting position, so that one metre along the normal shows the whole way.
  way_ = rest_ + rest_normals_;
  model_.pose_mesh(way_, joints, q, way_);
  way_ -= base_;
  stand();
}

void DetailLayer::stand() {
  for (int v = 0; v < system_.size(); ++v) posed_.col(v) = base_.col(v) + static_cast<float>(offsets_[v]) * way_.col(v);
  vertex_normals(posed_, model_.data().faces, normals_);
  surface_.set(posed_, normals_);
}

void DetailLayer::collect(const Observation& observation, int points, float robust, float reach, double trust) {
  const Cloud& cloud = observation.cloud;
  const int count = std::min(points, cloud.size);
  const float scale2 = robust * robust, base_weight = static_cast<float>(trust / (settings_.sigma * settings_.sigma));
  const Faces& faces = model_.data().faces;
  for (int s = 0; s < count; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count);
    const Eigen::Vector3f p(cloud.x[i], cloud.y[i], cloud.z[i]), pn(cloud.nx[i], cloud.ny[i], cloud.nz[i]);
    const SurfaceFoot foot = surface_.closest(p, reach, pn, kNormalGate);
    if (foot.face < 0 || foot.distance > reach) continue;
    const auto t = faces.col(foot.face);
    Eigen::Vector3f normal = Eigen::Vector3f::Zero(), base = Eigen::Vector3f::Zero();
    for (int k = 0; k < 3; ++k) {
      normal += foot.weights[k] * normals_.col(t[k]);
      base += foot.weights[k] * base_.col(t[k]);
      if (moving_ && !observation.views.empty()) base += foot.weights[k] * observation.views[cloud.camera[i]].time_offset * velocity_.col(t[k]);
    }
    const float length = normal.norm();
    if (!(length > 0.1f)) continue;
    normal /= length;
    std::array<float, 3> a;
    float now = 0, sum = 0;
    for (int k = 0; k < 3; ++k) {
      a[static_cast<std::size_t>(k)] = foot.weights[k] * normal.dot(way_.col(t[k]));
      sum += a[static_cast<std::size_t>(k)];
      now += a[static_cast<std::size_t>(k)] * static_cast<float>(offsets_[t[k]]);
    }
    if (sum < kSteep) continue;
    const float value = normal.dot(p - base), residual = value - now;
    const float robustness = 1 + residual * residual / scale2;
    system_.add(foot.face, a, value, base_weight / (robustness * robustness));
  }
}

void DetailLayer::solve() {
  system_.solve({.step = 1 / (settings_.step * settings_.step), .size = 1 / (settings_.size * settings_.size)}, settings_.solver_steps, offsets_);
  const double most = static_cast<double>(settings_.most);
  offsets_ = offsets_.cwiseMax(-most).cwiseMin(most);
}

void DetailLayer::fit(const Observation& observation, const ShapeVector& beta, const PoseVector& q, int rounds) {
  reset();
  place(beta, q);
  for (int round = 0; round < rounds; ++round) {
    system_.reset();
    // Wide at first, so that the surface gets to where cloth and hair are; then points that belong to something else lose their say.
    const float wide = static_cast<float>(std::max(1.0, 3.0 - round));
    collect(observation, settings_.points, wide * settings_.robust, settings_.reach, 1);
    solve();
    stand();
  }
  moments_ = 1;
}

void DetailLayer::add(const Observation& observation, const ShapeVector& beta, const PoseVector& q) {
  const double gap = observation.time - time_;
  const bool had_before = moments_ > 0;
  if (had_before) before_ = base_;
  place(beta, q);
  moving_ = had_before && gap > 1e-3 && gap < kLongestGap;
  if (moving_) velocity_ = (base_ - before_) / static_cast<float>(gap);
  system_.scale(1 - 1 / settings_.frames);
  const float wide = std::max(1.0f, 3.0f - static_cast<float>(moments_));
  collect(observation, settings_.points, wide * settings_.robust, settings_.reach, settings_.frame_trust);
  solve();
  time_ = observation.time;
  ++moments_;
}

bool DetailLayer::seen(int vertex) const { return system_.information(vertex) > 1 / (settings_.step * settings_.step); }

void DetailLayer::apply(const Vertices& rest, Vertices& out) const { displace(rest, model_.data().faces, offsets_, out); }

DistanceStatistics DetailLayer::distances(const Cloud& cloud, const ShapeVector& beta, const PoseVector& q) {
  place(beta, q);
  DistanceStatistics out;
  const int count = std::min(kDistancePoints, cloud.size);
  if (count == 0) return out;
  std::vector<double> distance;
  double sum = 0;
  for (int s = 0; s < count; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count);
    distance.push_back(static_cast<double>(std::min(kFar, surface_.distance({cloud.x[i], cloud.y[i], cloud.z[i]}))));
    sum += distance.back();
  }
  std::sort(distance.begin(), distance.end());
  out.mean = sum / count;
  out.median = distance[distance.size() / 2];
  out.p95 = distance[distance.size() * 95 / 100];
  return out;
}

std::size_t DetailLayer::memory_bytes() const {
  const auto n = static_cast<std::size_t>(model_.vertex_count());
  return sizeof(*this) + system_.memory_bytes() + n * (8 * 3 * sizeof(float) + sizeof(double) + 9 * sizeof(float)) +
         static_cast<std::size_t>(model_.data().faces.size()) * 9 * sizeof(int);
}

void displace(const Vertices& rest, const Faces& faces, const Eigen::VectorXd& offsets, Vertices& out) {
  Vertices normals;
  vertex_normals(rest, faces, normals);
  out = rest;
  for (Eigen::Index v = 0; v < rest.cols(); ++v) out.col(v) += static_cast<float>(offsets[v]) * normals.col(v);
}

}  // namespace booth::fit
