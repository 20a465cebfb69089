// Bones are kept for a moment after their person was lost, so that somebody else nearby does not become the person meanwhile; halves are tried one a frame.
#include "fit/track/followed_person.hpp"

#include <algorithm>
#include <cmath>

namespace booth::fit {
namespace {

constexpr double kFresh = 0.2;                         // seconds; after longer the person may be further from where they were going than their flesh reaches
constexpr double kKept = 1.0;                          // seconds
constexpr double kSpeed = 5;                           // m/s along an axis; a joint that was faster was lost before
constexpr float kStrays = 0.5f, kStraysPerSecond = 3;  // m, m/s; how far from its bones a person may be found again

constexpr double kTwoPeople = 0.25;                    // share of the cloud that a body leaves, from which on it may be one of two people;
constexpr double kCrowdedTwoPeople = 0.35;             // where others were cut off, some of theirs is left
constexpr double kHalfGain = 0.5;                      // of what the whole left is what a half may leave, to be a person;
constexpr double kHalfCoverage = 0.6;                  // and so much of the body's surface must be seen, of that of the whole's body
constexpr double kPatience = 0.5, kMostPatience = 64;  // seconds of doubt about who is followed before halves are tried; doubled where they were of no use
constexpr int kFewestPoints = 1000;                    // a frame with fewer says nothing of a half
constexpr int kHalvingPoints = 2000, kHalvingRounds = 10;
constexpr float kApart = 0.3f, kUpright = 0.9f;               // m, of the halves from each other, and of either's top above the floor
constexpr float kColumnRadius = 0.45f, kColumnHeight = 2.2f;  // m, of what is taken for a half;
constexpr float kBeyond = 0.2f;                               // and the share of the cloud that must be outside: one person is hardly wider

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
  known_ = last_found_ = crowded_ = false;
  stage_ = Stage::follows;
  patience_ = 0;
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
  // Half the spread along the direction in which the cloud is longest, from square roots alone: the same bits on every machine.
  const float half = 0.5f * (spread(0, 0) - spread(1, 1)), root = std::sqrt(half * half + spread(0, 1) * spread(0, 1));
  Eigen::Vector2f along = half >= 0 ? Eigen::Vector2f(half + root, spread(0, 1)) : Eigen::Vector2f(spread(0, 1), root - half);
  if (!(along.squaredNorm() > 0)) return false;
  along *= std::sqrt((0.5f * (spread(0, 0) + spread(1, 1)) + root) / along.squaredNorm());
  halves_ = {mean - along, mean + along};
  std::array<float, 2> top{}, outside{};
  for (int round = 0; round < kHalvingRounds; ++round) {
    std::array<Eigen::Vector2f, 2> sum{Eigen::Vector2f::Zero(), Eigen::Vector2f::Zero()};
    std::array<float, 2> n{};
    top = outside = {0, 0};
    for (int i = 0; i < cloud.size; i += step) {
      const std::size_t k = (at(i) - halves_[0]).squaredNorm() <= (at(i) - halves_[1]).squaredNorm() ? 0 : 1;
      sum[k] += at(i), ++n[k];
      top[k] = std::max(top[k], cloud.y[static_cast<std::size_t>(i)] - observation.floor_height);
      for (std::size_t h = 0; h < 2; ++h) outside[h] += (at(i) - halves_[h]).squaredNorm() > kColumnRadius * kColumnRadius ? 1.0f : 0.0f;
    }
    if (n[0] == 0 || n[1] == 0) return false;
    for (std::size_t k = 0; k < 2; ++k) halves_[k] = sum[k] / n[k];
  }
  const bool lately = known_ && observation.time - seen_ < kKept;
  const Eigen::Vector2f from = lately ? Eigen::Vector2f(static_cast<float>(joints_(0, 0)), static_cast<float>(joints_(2, 0))) : centre_;
  if ((halves_[1] - from).squaredNorm() < (halves_[0] - from).squaredNorm()) std::swap(halves_[0], halves_[1]);
  halved_ = observation.time;
  return std::min(top[0], top[1]) > kUpright && std::min(outside[0], outside[1]) > kBeyond * count && (halves_[0] - halves_[1]).norm() > kApart;
}

/// The body leaves so much of the cloud that it may be one of two people: at once where it was found just now, else after a while of it.
bool FollowedPerson::doubtful(const FitResult& result, const Observation& observation) {
  const double time = observation.time;
  if (observation.cloud.size < kFewestPoints) return false;
  const bool found = result.state != FitState::lost;
  if (found && result.energy.cloud_to_model < (observation.crowded ? kCrowdedTwoPeople : kTwoPeople)) {
    convinced_ = time;
    patience_ = kPatience;
    return false;
  }
  const bool nobody_yet = patience_ == 0;
  return nobody_yet || time - convinced_ > patience_;
}

bool FollowedPerson::remember(const FitResult& result, const Observation& observation) {
  const bool followed = last_found_ && result.state == FitState::tracked;
  const bool found = result.state != FitState::lost;
  bool told = true;
  if (stage_ == Stage::first_half || stage_ == Stage::second_half) {
    told = false;
    if (observation.cloud.size >= kFewestPoints) {  // without images the half is tried with the next frame
      const double coverage = kHalfCoverage * std::max(whole_coverage_, 0.5);
      told = found && observation.crowded && result.energy.cloud_to_model < kHalfGain * whole_left_ && result.coverage > coverage;
      stage_ = told ? Stage::follows : stage_ == Stage::first_half ? Stage::second_half : Stage::whole;
    }
    if (told) convinced_ = observation.time, patience_ = kPatience;
  } else if (stage_ == Stage::whole) {
    stage_ = Stage::follows;
    convinced_ = observation.time;
    patience_ = std::clamp(2 * patience_, kPatience, kMostPatience);
  } else if (doubtful(result, observation) && halve(observation)) {
    stage_ = Stage::first_half;
    whole_left_ = found ? result.energy.cloud_to_model : 1;
    whole_coverage_ = found ? result.coverage : 0;
    told = false;
  }
  // Where nothing was seen the bones are as good as they were.
  if (found || observation.cloud.size >= kFewestPoints) last_found_ = found && told;
  if (!found || !told) return told;
  velocity_.setZero();
  if (const double step = observation.time - seen_; followed && step > 0) velocity_ = ((result.joints - joints_) / step).cwiseMax(-kSpeed).cwiseMin(kSpeed);
  joints_ = result.joints;
  crowded_ = observation.crowded;
  seen_ = observation.time;
  known_ = true;
  return true;
}

Followed FollowedPerson::at(double time) {
  if (stage_ != Stage::follows && !(time - halved_ < kKept)) stage_ = Stage::follows;  // who stood there may be anywhere
  if (stage_ == Stage::first_half || stage_ == Stage::second_half) {
    const Eigen::Vector2f half = halves_[stage_ == Stage::first_half ? 0 : 1];
    bones_[0] = {{half.x(), 0, half.y()}, {half.x(), kColumnHeight, half.y()}, kColumnRadius};
    return {.bones = std::span(bones_).first(1), .now = true, .strayed = kStrays};
  }
  const double age = time - seen_;
  if (stage_ == Stage::whole || !known_ || age < 0 || age > kKept) return {};
  const Points3 joints = joints_ + std::min(age, kFresh) * velocity_;
  for (int b = 0; b < kBones; ++b) bones_[static_cast<std::size_t>(b)] = {joints.col(start_joint(b)).cast<float>(), joints.col(b).cast<float>(), radius(b)};
  return {.bones = bones_, .now = last_found_ && age < kFresh, .crowded = crowded_, .strayed = kStrays + kStraysPerSecond * static_cast<float>(age)};
}

}  // namespace booth::fit
