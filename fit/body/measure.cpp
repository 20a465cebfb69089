// Plane sections of the resting mesh, their convex hulls, and the lengths between landmarks.
#include "fit/body/measure.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

namespace booth::fit {
namespace {

constexpr double kGlutealFold = 0.025;  // below the crotch, metres

struct Description {
  std::string_view name, unit;
};
constexpr std::array<Description, kMeasures> kDescriptions{{
    {"stature", "m"},
    {"mass", "kg"},
    {"volume", "m^3"},
    {"chest_girth", "m"},
    {"waist_girth", "m"},
    {"buttock_girth", "m"},
    {"thigh_girth", "m"},
    {"calf_girth", "m"},
    {"shoulder_breadth", "m"},
    {"arm_length", "m"},
    {"leg_length", "m"},
    {"crotch_height", "m"},
}};

/// sd^2 = kScale^2 * (carried variance) + unexplained^2, set by `booth-uncertainty-study` on people who are neither in the models nor set aside.
constexpr double kScale = 1;
constexpr std::array<double, kMeasures> kUnexplained{
    0.0098,                           // stature
    0.35,   0.00035,                  // mass, volume
    0.005,  0.0071,  0.0081,          // chest, waist, buttock
    0.0100, 0.0142,                   // thigh, calf
    0.0048, 0.0124,  0.0118, 0.0097,  // shoulder breadth, arm, leg, crotch
};

/// Length of the convex hull of points in a plane (monotone chain). Sorts its argument.
double hull_length(std::vector<Eigen::Vector2d>& p) {
  if (p.size() < 3) return 0;
  std::sort(p.begin(), p.end(), [](const auto& a, const auto& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  std::vector<Eigen::Vector2d> hull(2 * p.size());
  std::size_t n = 0;
  const auto add = [&](const Eigen::Vector2d& q, std::size_t least) {
    const auto turn = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return (b.x() - a.x()) * (q.y() - a.y()) - (b.y() - a.y()) * (q.x() - a.x()); };
    while (n >= least + 2 && turn(hull[n - 2], hull[n - 1]) <= 0) --n;
    hull[n++] = q;
  };
  for (const auto& q : p) add(q, 0);
  const std::size_t lower = n - 1;
  for (std::size_t i = p.size() - 1; i-- > 0;) add(p[i], lower);
  double length = 0;
  for (std::size_t i = 0; i + 1 < n; ++i) length += (hull[i + 1] - hull[i]).norm();
  return length;
}

}  // namespace

std::string_view measure_name(Measure m) { return kDescriptions[static_cast<std::size_t>(m)].name; }
std::string_view measure_unit(Measure m) { return kDescriptions[static_cast<std::size_t>(m)].unit; }

Measurer::Measurer(const BodyModelData& data) : faces_(data.faces), mirror_(data.mirror_vertex) {
  const auto vertices = data.mean.cols();
  if (data.landmarks.size() != kLandmarks)
    throw std::invalid_argument("body model: landmarks has size " + std::to_string(data.landmarks.size()) + ", expected " + std::to_string(kLandmarks));
  if (data.landmarks.minCoeff() < 0 || data.landmarks.maxCoeff() >= vertices)
    throw std::invalid_argument("body model: landmarks names a vertex that does not exist");
  for (int i = 0; i < kLandmarks; ++i) landmark_[static_cast<std::size_t>(i)] = data.landmarks[i];

  std::vector<char> arm(static_cast<std::size_t>(vertices));
  for (Eigen::Index v = 0; v < vertices; ++v) {
    float weight = 0;
    for (int i = 0; i < kSkinBones; ++i) {
      const std::string_view bone = bones()[data.skin_bone(i, v)].name;
      if (bone.ends_with("humerus") || bone.ends_with("radius") || bone.ends_with("hand")) weight += data.skin_weight(i, v);
    }
    arm[static_cast<std::size_t>(v)] = weight > 0.5f;
  }
  std::set<std::pair<int, int>> edges;
  for (Eigen::Index f = 0; f < faces_.cols(); ++f)
    for (int i = 0; i < 3; ++i) edges.insert(std::minmax(faces_(i, f), faces_((i + 1) % 3, f)));
  const auto left = [&](int v) { return mirror_[v] == v || data.mean(0, v) > data.mean(0, mirror_[v]); };
  for (const auto& [a, b] : edges) {
    if (arm[static_cast<std::size_t>(a)] || arm[static_cast<std::size_t>(b)]) continue;
    trunk_.emplace_back(a, b);
    if (left(a) && left(b)) left_leg_.emplace_back(a, b);
  }
}

double Measurer::girth(const Vertices& rest, const Edges& edges, double height) {
  std::vector<Eigen::Vector2d> section;
  for (const auto& [a, b] : edges) {
    const double ya = rest(1, a) - height, yb = rest(1, b) - height;
    if ((ya < 0) == (yb < 0)) continue;
    const double t = ya / (ya - yb);
    section.emplace_back(rest(0, a) + t * (rest(0, b) - rest(0, a)), rest(2, a) + t * (rest(2, b) - rest(2, a)));
  }
  return hull_length(section);
}

MeasureValues Measurer::measure(const Vertices& rest, const Points3& joints) const {
  const auto point = [&](Landmark l) -> Eigen::Vector3d { return rest.col(landmark_[static_cast<std::size_t>(l)]).cast<double>(); };
  const auto other = [&](Landmark l) -> Eigen::Vector3d { return rest.col(mirror_[landmark_[static_cast<std::size_t>(l)]]).cast<double>(); };
  // Both sides' mean, so that a slight tilt does not change a level.
  const auto level = [&](Landmark l) { return (point(l).y() + other(l).y()) / 2; };
  static const int elbow = joint_index("lelbow"), wrist = joint_index("lwrist"), knee = joint_index("lknee"), ankle = joint_index("lankle");

  const double floor = rest.row(1).minCoeff();
  double volume = 0;
  for (Eigen::Index f = 0; f < faces_.cols(); ++f) {
    const auto t = faces_.col(f);
    volume += rest.col(t[0]).cast<double>().dot(rest.col(t[1]).cast<double>().cross(rest.col(t[2]).cast<double>()));
  }
  volume /= 6;

  MeasureValues m{};
  const auto set = [&](Measure which, double value) { m[static_cast<std::size_t>(which)] = value; };
  set(Measure::stature, rest.row(1).maxCoeff() - floor);
  set(Measure::volume, volume);
  set(Measure::mass, volume * kBodyDensity);
  set(Measure::chest_girth, girth(rest, trunk_, level(Landmark::nipple)));
  set(Measure::waist_girth, girth(rest, trunk_, level(Landmark::navel)));
  set(Measure::buttock_girth, girth(rest, trunk_, level(Landmark::buttock)));
  set(Measure::thigh_girth, girth(rest, left_leg_, level(Landmark::crotch) - kGlutealFold));
  double calf = 0;
  for (double part : {0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45})
    calf = std::max(calf, girth(rest, left_leg_, joints(1, knee) + part * (joints(1, ankle) - joints(1, knee))));
  set(Measure::calf_girth, calf);
  set(Measure::shoulder_breadth, (point(Landmark::acromion) - other(Landmark::acromion)).norm());
  set(Measure::arm_length, (point(Landmark::acromion) - joints.col(elbow)).norm() + (joints.col(elbow) - joints.col(wrist)).norm());
  set(Measure::leg_length, level(Landmark::trochanterion) - floor);
  set(Measure::crotch_height, level(Landmark::crotch) - floor);
  return m;
}

std::vector<Measurement> named(const MeasureValues& values) {
  std::vector<Measurement> list;
  for (std::size_t i = 0; i < values.size(); ++i) list.push_back({kDescriptions[i].name, values[i], kDescriptions[i].unit, 0});
  return list;
}

double calibrated_measure_sd(Measure m, double variance) {
  const double unexplained = kUnexplained[static_cast<std::size_t>(m)];
  return std::sqrt(kScale * kScale * variance + unexplained * unexplained);
}

double propagated_variance_of(Measure m, double sd) {
  const double unexplained = kUnexplained[static_cast<std::size_t>(m)];
  return std::max(0.0, sd * sd - unexplained * unexplained) / (kScale * kScale);
}

std::vector<Measurement> measure_with_sd(const BodyModel& model, const ShapeVector& beta, const ShapeMatrix& covariance) {
  const Measurer measurer(model.data());
  const int all = model.shape_count(), known = covariance.rows() == beta.size() ? static_cast<int>(beta.size()) : 0;
  ShapeVector whole = ShapeVector::Zero(all);
  whole.head(std::min<Eigen::Index>(all, beta.size())) = beta.head(std::min<Eigen::Index>(all, beta.size()));
  Vertices rest, moved;
  model.shaped(whole, rest);
  const MeasureValues values = measurer.measure(rest, model.rest_joints(whole));
  // One-sided differences over a quarter of a standard deviation: girths are hulls, with kinks smaller than that.
  constexpr double kStep = 0.25;
  Eigen::Matrix<double, kMeasures, Eigen::Dynamic, 0, kMeasures, kMaxShape> slope(kMeasures, all);
  for (int k = 0; k < all; ++k) {
    ShapeVector other = whole;
    other[k] += kStep;
    moved = rest;
    moved.reshaped() += static_cast<float>(kStep) * model.data().directions.col(k);
    const MeasureValues there = measurer.measure(moved, model.rest_joints(other));
    for (int m = 0; m < kMeasures; ++m) slope(m, k) = (there[static_cast<std::size_t>(m)] - values[static_cast<std::size_t>(m)]) / kStep;
  }
  std::vector<Measurement> list = named(values);
  for (int m = 0; m < kMeasures; ++m) {
    const auto own = slope.row(m).head(known);
    const double carried = known > 0 ? (own * covariance * own.transpose()).value() : 0.0;
    list[static_cast<std::size_t>(m)].sd = calibrated_measure_sd(static_cast<Measure>(m), carried + slope.row(m).tail(all - known).squaredNorm());
  }
  return list;
}

std::vector<Measurement> measure(const BodyModel& model, const ShapeVector& beta) {
  Vertices rest;
  model.shaped(beta, rest);
  return named(Measurer(model.data()).measure(rest, model.rest_joints(beta)));
}

}  // namespace booth::fit
