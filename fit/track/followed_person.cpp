// Bones are kept for a moment after their person was lost, so that somebody else nearby does not become the person meanwhile; halves are tried one a frame.
#include "fit/track/followed_person.hpp"

#include <algorithm>
#include <cmath>

namespace booth::fit {
namespace {

constexpr double kFresh = 0.15;  // seconds; after longer the person may be further from where they were going than their flesh reaches
constexpr double kKept = 1.0;
constexpr double kSpeed = 5;  // m/s along an axis; a joint that was faster was lost before

constexpr double kTwoPeople = 0.25;    // share of the cloud that a start leaves, from which on it may be of two people
constexpr double kHalfGain = 0.5;      // of what the whole left is what a half may leave, to be a person;
constexpr double kHalfCoverage = 0.5;  // and so much of the body's surface must be seen
constexpr int kHalvingPoints = 2000, kHalvingRounds = 10;
constexpr float kApart = 0.25f, kUpright = 0.9f;              // m, of the halves from each other, and of either's top above the floor
constexpr float kColumnRadius = 0.45f, kColumnHeight = 2.2f;  // m, of what is taken for a half

// m; an adult's flesh, clothed, and what a motion's change of speed makes of it in a frame or two.
constexpr float kTrunk = 0.28f, kThigh = 0.22f, kHead = 0.22f, kLimb = 0.16f;

float radius(int bone) {
  static const std::array<float, kBones> radii = [] {
    std::array<float, kBones> r;
    r.fill(kLimb);
    for (const char* name : {"root", "lhip", "rhip", "spine_pivot", "chest_top", "lshoulder", "rshoulder"})
      r[static_cast<std::size_t>(joint_index(name))] = kTrunk;
    for (const char* name : {"lknee", "rknee"}) r[static_cast<std::size_t>(joint_index(name))] = kThigh;
    for (const char* name : {"neck_pivot", "head_base", "head_top"}) r[static_cast<std::size_t>(joint_index(name))] = kHead;
    return r;
  }();
  return radii[static_cast<std::size_t>(bone)];
}

}  // namespace

void FollowedPerson::forget() {
  known_ = last_found_ = false;
  stage_ = Stage::follows;
}

/// Two-means over the floor. False where the cloud has no two upright halves.
bool FollowedPerson::halve(const Observation& observation) {
  const Cloud& cloud = observation.cloud;
  const int step = std::max(1, cloud.size / kHalvingPoints);
  const auto at = [&](int i) { return Eigen::Vector2f(cloud.x[static_cast<std::size_t>(i)], cloud.z[static_cast<std::size_t>(i)]); };
  Eigen::Vector2f mean = Eigen::Vector2f::Zero();
  Eigen::Matrix2f square = Eigen::Matrix2f::Zero();
  float count = 0;
  for (int i = 0; i < cloud.size; i += step) mean += at(i), square += at(i) * at(i).transpose(), ++count;
  if (count == 0) return false;
  mean /= count;
  const Eigen::Matrix2f spread = square / count - mean * mean.transpose();
  // The direction in which the cloud is longest.
  const float turn = 0.5f * std::atan2(2 * spread(0, 1), spread(0, 0) - spread(1, 1));
  const Eigen::Vector2f along(std::cos(turn), std::sin(turn));
  const float reach = std::sqrt(std::max(0.0f, along.dot(spread * along)));
  halves_ = {mean - reach * along, mean + reach * along};
  std::array<float, 2> top{};
  for (int round = 0; round < kHalvingRounds; ++round) {
    std::array<Eigen::Vector2f, 2> sum{Eigen::Vector2f::Zero(), Eigen::Vector2f::Zero()};
    std::array<float, 2> n{};
    top = {0, 0};
    for (int i = 0; i < cloud.size; i += step) {
      const std::size_t k = (at(i) - halves_[0]).squaredNorm() <= (at(i) - halves_[1]).squaredNorm() ? 0 : 1;
      sum[k] += at(i), ++n[k];
      top[k] = std::max(top[k], cloud.y[static_cast<std::size_t>(i)] - observation.floor_height);
    }
    if (n[0] == 0 || n[1] == 0) return false;
    for (std::size_t k = 0; k < 2; ++k) halves_[k] = sum[k] / n[k];
  }
  if ((halves_[1] - centre_).squaredNorm() < (halves_[0] - centre_).squaredNorm()) std::swap(halves_[0], halves_[1]);
  return std::min(top[0], top[1]) > kUpright && (halves_[0] - halves_[1]).norm() > kApart;
}

/// A start whose body leaves so much of an unhalved cloud that it may be of two people.
bool FollowedPerson::doubtful(const FitResult& result, const Observation& observation) const {
  return stage_ == Stage::follows && result.state != FitState::tracked && !observation.crowded && observation.cloud.size > 0 &&
         (result.state == FitState::lost ? !last_found_ : result.energy.cloud_to_model > kTwoPeople);
}

bool FollowedPerson::remember(const FitResult& result, const Observation& observation) {
  const bool followed = last_found_ && result.state == FitState::tracked;
  const bool found = result.state != FitState::lost;
  bool told = true;
  if (doubtful(result, observation) && halve(observation)) {
    stage_ = Stage::first_half;
    whole_left_ = found ? result.energy.cloud_to_model : 1;
    told = false;
  } else if (stage_ == Stage::first_half || stage_ == Stage::second_half) {
    const bool person = found && observation.crowded && result.energy.cloud_to_model < kHalfGain * whole_left_ && result.coverage > kHalfCoverage;
    told = person;
    stage_ = person ? Stage::follows : stage_ == Stage::first_half ? Stage::second_half : Stage::whole;
  } else if (stage_ == Stage::whole) {
    stage_ = Stage::settled;
  } else if (observation.cloud.size == 0) {
    stage_ = Stage::follows;  // who comes next may be two
  }
  last_found_ = found && told;
  if (!last_found_) return told;
  velocity_.setZero();
  if (const double step = observation.time - seen_; followed && step > 0) velocity_ = ((result.joints - joints_) / step).cwiseMax(-kSpeed).cwiseMin(kSpeed);
  joints_ = result.joints;
  crowded_ = observation.crowded;
  seen_ = observation.time;
  known_ = true;
  return true;
}

Followed FollowedPerson::at(double time) {
  if (stage_ == Stage::first_half || stage_ == Stage::second_half) {
    const Eigen::Vector2f half = halves_[stage_ == Stage::first_half ? 0 : 1];
    bones_[0] = {{half.x(), 0, half.y()}, {half.x(), kColumnHeight, half.y()}, kColumnRadius};
    return {.bones = std::span(bones_).first(1), .now = true};
  }
  const double age = time - seen_;
  if (stage_ == Stage::whole || !known_ || age < 0 || age > kKept) return {};
  const Points3 joints = joints_ + std::min(age, kFresh) * velocity_;
  for (int b = 0; b < kBones; ++b) bones_[static_cast<std::size_t>(b)] = {joints.col(start_joint(b)).cast<float>(), joints.col(b).cast<float>(), radius(b)};
  return {.bones = bones_, .now = last_found_ && age < kFresh, .crowded = crowded_};
}

}  // namespace booth::fit
