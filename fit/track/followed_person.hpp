// The tracker's word to the cloud: whose points the next frame's are. Also whether what was fitted is two people at once.
#pragma once

#include <array>

#include "fit/cloud/cloud_builder.hpp"
#include "fit/estimator.hpp"

namespace booth::fit {

/// Between an Estimator's steps and a CloudBuilder's builds. Two people who touch before anybody is followed are one component, which no body explains: then
/// the next frames are tried with either half of it, first the one nearer to who was followed, or to the stage's centre. Allocates nothing. One thread calls at
/// a time; the order is at(), build(), start_over(), step(), remember().
class FollowedPerson {
 public:
  /// `settings` as the CloudBuilder has them: where the stage's centre is.
  explicit FollowedPerson(const CloudSettings& settings) : centre_(settings.stage_x, settings.stage_z) {}

  /// For CloudBuilder::build() of the observation at `time`; holds until the next call.
  Followed at(double time);
  /// The Estimator has to start over before its step with that observation: it is the first with another half, or with the whole again.
  bool start_over() const { return stage_ != Stage::follows; }
  /// After each step of the Estimator. False: the result is one of two people at once, or of half of something, and is not to be told.
  bool remember(const FitResult& result, const Observation& observation);
  /// The next person is another one.
  void forget();

 private:
  enum class Stage : std::uint8_t {
    follows,
    first_half,  // the next frame is tried with it
    second_half,
    whole,  // neither half is a person: with all again
  };
  bool halve(const Observation& observation);
  bool doubtful(const FitResult& result, const Observation& observation);

  Eigen::Vector2f centre_;
  std::array<Followed::Bone, kBones> bones_;
  Points3 joints_ = Points3::Zero(), velocity_ = Points3::Zero();
  double seen_ = 0;  ///< time of the joints
  bool known_ = false, last_found_ = false, crowded_ = false;
  Stage stage_ = Stage::follows;
  std::array<Eigen::Vector2f, 2> halves_;  ///< x, z
  double halved_ = 0;                      ///< time of them
  double whole_left_ = 0;                  ///< of the cloud, by the body that was fitted to all of it: EnergyTerms::cloud_to_model
  double whole_coverage_ = 0;              ///< FitResult::coverage of it
  double convinced_ = 0;                   ///< time of the last frame that gave no doubt, or of halves that were of no use
  double patience_ = 0;                    ///< seconds of doubt before halves are tried again
};

}  // namespace booth::fit
