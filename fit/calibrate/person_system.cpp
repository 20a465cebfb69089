// Rows of points on the body, a Schur complement for each moment, and the gauge that the majority of the cameras sets.
#include "fit/calibrate/person_system.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "fit/cloud/projection.hpp"

namespace booth::fit::calibrate {
namespace {

constexpr int kMostSamples = 400;
constexpr float kReach = 0.12f;                     // m; how far from the body a point may be
constexpr float kNormalGate = 0.35f;                // cosine between a point's and the body's normal
constexpr float kGrazing = 0.25f;                   // cosine between normal and line of sight below which a time-of-flight camera errs most
constexpr float kRobust = 0.04f;                    // m, Geman-McClure
constexpr double kLongestStep = 0.12;               // s between frames that follow each other
constexpr double kFastest = 25, kFastestMove = 6;   // rad/s, m/s: nobody moves so; the fit jumped
constexpr int kFewPoints = 80;                      // of the person in a picture: fewer are none
constexpr int kManyPoints = 1500;                   // of all cameras together: fewer say nothing of who sees the person
constexpr double kFewMoments = 5;                   // fewer say nothing of a camera
constexpr double kPoseTurn = 0.3, kPoseMove = 0.3;  // rad, m: how far a moment's pose may be from what was fitted
constexpr double kOutside = 0.01;                   // m, standard deviation of the points' common distance from the body
// Second moments of a standing person about its middle, m^2: how much a turn about x, y, z moves its points.
const Eigen::Vector3d kSpread(0.22, 0.05, 0.22);

}  // namespace

double displacement_of(const Vector6& step) { return std::sqrt(step.head<3>().cwiseAbs2().dot(kSpread) + step.tail<3>().squaredNorm()); }

PersonSystem::PersonSystem(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, const PersonSystemSettings& settings)
    : settings_(settings), grid_(std::max({1, men ? men->vertex_count() : 0, women ? women->vertex_count() : 0})) {
  if (settings.cameras < 1 || settings.cameras > PersonSystemSettings::kMostCameras || settings.samples < 1 || settings.samples > kMostSamples ||
      settings.stride < 1)
    throw std::invalid_argument("person system: 1 to 8 cameras, 1 to 400 samples and a stride of 1 or more are possible");
  if (!men && !women) throw std::invalid_argument("person system: there is no body model");
  for (const auto& model : {men, women})
    if (model) {
      Body& body = body_[static_cast<std::size_t>(model->sex())];
      body.poser = std::make_unique<Poser>(*model, std::min(24, model->shape_count()), model->vertex_count());
      models_.push_back(model);
    }
  samples_.reserve(static_cast<std::size_t>(settings.samples * settings.cameras));
  clear();
}

void PersonSystem::clear() {
  const int n = common_unknown() + kCommon;
  information_ = Matrix::Zero(n, n);
  gradient_ = Vector::Zero(n);
  moments_ = expected_ = missed_ = {};
  says_ = {};
  pending_ = have_last_ = false;
}

void PersonSystem::forget(double share) {
  information_ *= share;
  gradient_ *= share;
  for (auto* counts : {&moments_, &expected_, &missed_})
    for (double& c : *counts) c *= share;
}

void PersonSystem::add(const PersonSystem& other) {
  information_ += other.information_;
  gradient_ += other.gradient_;
  for (std::size_t c = 0; c < moments_.size(); ++c) {
    moments_[c] += other.moments_[c];
    expected_[c] += other.expected_[c];
    missed_[c] += other.missed_[c];
  }
}

std::size_t PersonSystem::memory_bytes() const {
  std::size_t bytes = sizeof(*this) + grid_.memory_bytes() + samples_.capacity() * sizeof(Sample);
  for (const Body& b : body_)
    if (b.poser) bytes += b.poser->memory_bytes();
  return bytes;
}

bool PersonSystem::observe(const Observation& o, const FitResult& r) {
  // Other people's points would look like a camera that moved.
  if (r.state != FitState::tracked || !r.body_accepted || o.crowded || static_cast<int>(o.views.size()) != settings_.cameras || !r.q.allFinite()) {
    pending_ = have_last_ = false;
    return false;
  }
  const double dt = o.time - last_time_;
  const bool goes_on = have_last_ && r.sex == last_sex_ && dt > 0 && dt < kLongestStep;
  const bool added = pending_ && goes_on && add_moment(r.q, o.time);
  pending_ = false;
  ++skipped_;
  if (goes_on && skipped_ >= settings_.stride && body_[static_cast<std::size_t>(r.sex)].poser) {
    take_samples(o, r);
    before_ = last_;
    time_before_ = last_time_;
    q_ = r.q;
    beta_ = r.beta;
    sex_ = r.sex;
    skipped_ = 0;
    pending_ = true;
  }
  last_ = r.q;
  last_time_ = o.time;
  last_sex_ = r.sex;
  have_last_ = true;
  return added;
}

void PersonSystem::take_samples(const Observation& o, const FitResult& r) {
  samples_.clear();
  for (int c = 0; c < settings_.cameras; ++c) {
    const View& view = o.views[static_cast<std::size_t>(c)];
    Seen& seen = seen_[static_cast<std::size_t>(c)];
    seen = {.valid = view.valid, .expected = false, .points = 0, .time_offset = view.time_offset, .centre = view.camera.centre()};
    if (!view.valid) continue;
    // The middle of the body must be well inside the picture.
    const Pixel middle = project(view.camera, r.joints.col(2).cast<float>());
    const auto w = static_cast<float>(view.camera.width), h = static_cast<float>(view.camera.height);
    seen.expected = middle.z > 0 && middle.u > 0.2f * w && middle.u < 0.8f * w && middle.v > 0.1f * h && middle.v < 0.9f * h;
  }
  for (int i = 0; i < o.cloud.size; ++i)
    if (const auto c = o.cloud.camera[static_cast<std::size_t>(i)]; c < settings_.cameras) ++seen_[c].points;
  std::array<std::int64_t, PersonSystemSettings::kMostCameras> at{};
  for (int k = 0; k < o.cloud.size; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const auto c = o.cloud.camera[i];
    if (c >= settings_.cameras) continue;
    // Evenly: the s-th of n points is taken when s * samples / n has just become another whole number.
    const std::int64_t n = std::max(seen_[c].points, settings_.samples), s = at[c]++;
    if (s * settings_.samples / n == (s + 1) * settings_.samples / n) continue;
    samples_.push_back({{o.cloud.x[i], o.cloud.y[i], o.cloud.z[i]}, {o.cloud.nx[i], o.cloud.ny[i], o.cloud.nz[i]}, c});
  }
}

bool PersonSystem::add_moment(const PoseVector& after, double time_after) {
  const PoseVector speed = (after - before_) / (time_after - time_before_);
  if (speed.head<3>().cwiseAbs().maxCoeff() > kFastestMove || speed.tail<kDofs - 3>().cwiseAbs().maxCoeff() > kFastest) return false;
  Body& body = body_[static_cast<std::size_t>(sex_)];
  Poser& poser = *body.poser;
  const Eigen::Index shape = std::min<Eigen::Index>(beta_.size(), poser.shape_count());
  beta_.conservativeResize(poser.shape_count());
  beta_.tail(poser.shape_count() - shape).setZero();
  if (body.shaped.size() != beta_.size() || body.shaped != beta_) {
    poser.set_shape(beta_);
    body.shaped = beta_;
  }
  poser.set_pose(q_);
  poser.prepare_shape_derivatives();
  grid_.rebuild(poser.x.data(), poser.y.data(), poser.z.data(), poser.nx.data(), poser.ny.data(), poser.nz.data(), poser.size());

  int all = 0;
  for (int c = 0; c < settings_.cameras; ++c) all += seen_[static_cast<std::size_t>(c)].points;
  for (int c = 0; c < settings_.cameras; ++c) {
    const auto i = static_cast<std::size_t>(c);
    const Seen& seen = seen_[i];
    const int met = seen.valid ? add_points(poser, speed, c) : (gram_[i].fill(0), 0);
    moments_[i] += met > settings_.samples / 4;
    if (!seen.valid || !seen.expected || all < kManyPoints) continue;
    expected_[i] += 1;
    missed_[i] += seen.points < kFewPoints || met < std::min(seen.points, settings_.samples) / 4;
  }
  eliminate_pose();
  return true;
}

/// A point, where its camera really stands and looked, lies on the body where it really was:
/// n . (p - x) - dt n.v + ((p - pivot) x n) . turn + n . shift + n.v late - row_q dq - row_b (b - b0) - outside = 0.
/// Returns how many points found their place.
int PersonSystem::add_points(const Poser& poser, const PoseVector& speed, int camera) {
  auto& gram = gram_[static_cast<std::size_t>(camera)];
  gram.fill(0);
  const CameraSays& known = says_[static_cast<std::size_t>(camera)];
  const Seen& seen = seen_[static_cast<std::size_t>(camera)];
  const Eigen::Vector3f pivot = settings_.pivot.cast<float>(), turn = known.step.head<3>().cast<float>(), shift = known.step.tail<3>().cast<float>();
  const auto known_late = static_cast<float>(known.late);
  const Eigen::Matrix<float, kDofs, 1> rate = speed.cast<float>();
  const auto weight = static_cast<float>(settings_.independent / (settings_.samples * settings_.sigma * settings_.sigma));
  constexpr int kStep = kDofs, kLate = kDofs + 6, kBeta = kLate + 1, kAway = kBeta + kShape, kConstant = kAway + 1;
  int met = 0;
  for (const Sample& s : samples_) {
    if (s.camera != camera) continue;
    const Eigen::Vector3f arm = s.p - pivot;
    const Eigen::Vector3f there = s.p + turn.cross(arm) + shift;
    const int v = s.n.isZero() ? grid_.nearest(there, kReach) : grid_.nearest(there, kReach, s.n, kNormalGate);
    if (v < 0) continue;
    ++met;
    const Eigen::Vector3f x = poser.position(v), n = poser.normal(v);
    if (n.dot(seen.centre - x) < kGrazing * (seen.centre - x).norm()) continue;
    std::array<float, kLocal> row{};
    std::array<float, 64> shape{};  // as many as the poser has, of which the first are kept
    poser.pose_row(v, n, row.data());
    poser.shape_row(v, n, shape.data());
    float along = 0;  // n . velocity
    for (int k = 0; k < kDofs; ++k) {
      along += row[static_cast<std::size_t>(k)] * rate[k];
      row[static_cast<std::size_t>(k)] = -row[static_cast<std::size_t>(k)];
    }
    const Eigen::Vector3f torque = arm.cross(n);
    for (int k = 0; k < 3; ++k) {
      row[static_cast<std::size_t>(kStep + k)] = torque[k];
      row[static_cast<std::size_t>(kStep + 3 + k)] = n[k];
    }
    row[kLate] = along;
    row[kAway] = -1;
    float constant = n.dot(s.p - x) - seen.time_offset * along;
    const float error = constant + torque.dot(turn) + n.dot(shift) + along * known_late;
    for (int k = 0; k < kShape; ++k) {
      row[static_cast<std::size_t>(kBeta + k)] = -shape[static_cast<std::size_t>(k)];
      if (k < beta_.size()) constant += shape[static_cast<std::size_t>(k)] * static_cast<float>(beta_[k]);
    }
    row[kConstant] = constant;
    const float t = 1 + error * error / (kRobust * kRobust);
    const float w = weight / (t * t);
    for (int i = 0; i < kLocal; ++i) {
      const float a = w * row[static_cast<std::size_t>(i)];
      if (a == 0) continue;
      float* out = gram.data() + i * kLocal;
      for (int j = i; j < kLocal; ++j) out[j] += a * row[static_cast<std::size_t>(j)];
    }
  }
  return met;
}

void PersonSystem::eliminate_pose() {
  const int n = common_unknown() + kCommon, common = common_unknown();
  pose_.setZero();
  pose_.diagonal().head<3>().setConstant(1 / (kPoseMove * kPoseMove));
  pose_.diagonal().tail<kDofs - 3>().setConstant(1 / (kPoseTurn * kPoseTurn));
  pose_gradient_.setZero();
  cross_.setZero(kDofs, n);
  moment_.setZero(n, n);
  moment_gradient_.setZero(n);
  for (int c = 0; c < settings_.cameras; ++c) {
    const auto& gram = gram_[static_cast<std::size_t>(c)];
    // Where a local unknown stands among all; the pose's come first in a row, its constant last.
    const auto place = [&](int k) { return k < kDofs + kPerCamera ? camera_unknown(c) + k - kDofs : common + k - kDofs - kPerCamera; };
    for (int i = 0; i < kLocal - 1; ++i)
      for (int j = i; j < kLocal; ++j) {
        const double g = gram[static_cast<std::size_t>(i * kLocal + j)];
        if (g == 0) continue;
        if (j == kLocal - 1) {
          (i < kDofs ? pose_gradient_[i] : moment_gradient_[place(i)]) += g;
        } else if (j < kDofs) {
          pose_(i, j) += g;
          if (i != j) pose_(j, i) += g;
        } else if (i < kDofs) {
          cross_(i, place(j)) += g;
        } else {
          moment_(place(i), place(j)) += g;
          if (i != j) moment_(place(j), place(i)) += g;
        }
      }
  }
  const Eigen::LDLT<Eigen::Matrix<double, kDofs, kDofs>> factor(pose_);
  solved_ = cross_;
  factor.solveInPlace(solved_);
  moment_.noalias() -= cross_.transpose().lazyProduct(solved_);
  moment_gradient_.noalias() -= solved_.transpose().lazyProduct(pose_gradient_);
  if (!moment_.allFinite() || !moment_gradient_.allFinite()) return;
  information_ += moment_;
  gradient_ += moment_gradient_;
}

void PersonSystem::add_priors(Matrix& a) const {
  for (int c = 0; c < settings_.cameras; ++c) {
    auto d = a.diagonal().segment<kPerCamera>(camera_unknown(c));
    d.head<3>().array() += 1 / (settings_.turn_sigma * settings_.turn_sigma);
    d.segment<3>(3).array() += 1 / (settings_.shift_sigma * settings_.shift_sigma);
    d[6] += 1 / (settings_.late_sigma * settings_.late_sigma);
  }
  auto d = a.diagonal().segment<kCommon>(common_unknown());
  d.head<kShape>().array() += 1;  // whitened
  d[kShape] += 1 / (kOutside * kOutside);
}

void PersonSystem::new_person() {
  const int n = common_unknown();
  work_ = information_;
  add_priors(work_);
  // Only the prior of what goes may be used up.
  using Common = Eigen::Matrix<double, kCommon, kCommon>;
  const Eigen::LDLT<Common> factor(Common(work_.bottomRightCorner<kCommon, kCommon>()));
  Eigen::Matrix<double, kCommon, Eigen::Dynamic, 0, kCommon, kMostUnknowns> solved = information_.bottomLeftCorner(kCommon, n);
  Eigen::Matrix<double, kCommon, 1> gradient = gradient_.tail<kCommon>();
  gradient_.head(n).noalias() -= information_.topRightCorner(n, kCommon).lazyProduct(factor.solve(gradient).eval());
  factor.solveInPlace(solved);
  work_.topLeftCorner(n, n).noalias() = information_.topRightCorner(n, kCommon).lazyProduct(solved);
  information_.topLeftCorner(n, n) -= work_.topLeftCorner(n, n);
  information_.rightCols(kCommon).setZero();
  information_.bottomRows(kCommon).setZero();
  gradient_.tail<kCommon>().setZero();
  pending_ = have_last_ = false;
}

void PersonSystem::solve() {
  const int n = common_unknown() + kCommon;
  work_ = information_;
  add_priors(work_);
  const Eigen::LDLT<Matrix> factor(work_);
  const Vector x = factor.solve(-gradient_);
  moment_.setIdentity(n, n);
  factor.solveInPlace(moment_);
  if (!x.allFinite() || !moment_.allFinite()) return;
  judge(x, moment_);
}

/// All cameras together may stand anywhere: the majority is taken to stand where it was (the geometric median of the steps, so that one camera that moved does
/// not move the measure), and the mean delay is none.
void PersonSystem::judge(const Vector& x, const Matrix& covariance) {
  std::array<int, PersonSystemSettings::kMostCameras> who{};
  std::size_t count = 0;
  for (int c = 0; c < settings_.cameras; ++c) {
    CameraSays& says = says_[static_cast<std::size_t>(c)];
    says = {};
    says.moments = moments_[static_cast<std::size_t>(c)];
    says.missed = expected_[static_cast<std::size_t>(c)] > 0 ? missed_[static_cast<std::size_t>(c)] / expected_[static_cast<std::size_t>(c)] : 0;
    if (says.moments >= kFewMoments) who[count++] = c;
  }
  if (count < 2) return;
  Vector6 middle = Vector6::Zero();
  double late = 0;
  for (std::size_t i = 0; i < count; ++i) {
    middle += x.segment<6>(camera_unknown(who[i])) / static_cast<double>(count);
    late += x[camera_unknown(who[i]) + 6] / static_cast<double>(count);
  }
  constexpr int kRounds = 20;
  constexpr double kNearest = 2e-4;  // m
  for (int round = 0; round < kRounds && count > 2; ++round) {
    Vector6 sum = Vector6::Zero();
    double weights = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Vector6 step = x.segment<6>(camera_unknown(who[i]));
      const double w = 1 / std::max(kNearest, displacement_of(step - middle));
      sum += w * step;
      weights += w;
    }
    middle = sum / weights;
  }
  const double others = static_cast<double>(count - 1);
  for (std::size_t i = 0; i < count; ++i) {
    CameraSays& says = says_[static_cast<std::size_t>(who[i])];
    says.step = x.segment<6>(camera_unknown(who[i])) - middle;
    says.displacement = displacement_of(says.step);
    says.late = x[camera_unknown(who[i]) + 6] - late;
    // Against the mean of the others: the common motion of all, of which little is known, cancels.
    Eigen::Matrix<double, kPerCamera, kPerCamera> spread = Eigen::Matrix<double, kPerCamera, kPerCamera>::Zero();
    for (std::size_t a = 0; a < count; ++a)
      for (std::size_t b = 0; b < count; ++b) {
        const double share = (a == i ? 1 : -1 / others) * (b == i ? 1 : -1 / others);
        spread += share * covariance.block<kPerCamera, kPerCamera>(camera_unknown(who[a]), camera_unknown(who[b]));
      }
    says.deviation = std::sqrt(std::max(0.0, spread.diagonal().head<3>().dot(kSpread) + spread.diagonal().segment<3>(3).sum()));
    const double mean_share = others / static_cast<double>(count);  // late is against the mean of all
    says.late_deviation = std::sqrt(std::max(0.0, spread(6, 6))) * mean_share;
  }
}

}  // namespace booth::fit::calibrate
