// The tracker's word to the cloud: whose points the next frame's are. Also whether a start was of two people at once.
#pragma once

#include <array>

#include "fit/cloud/cloud_builder.hpp"
#include "fit/estimator.hpp"

namespace booth::fit {

/// Between an Estimator's steps and a CloudBuilder's builds. Two people who touch before anybody is followed are one component, which no body explains: then
/// the next frames are tried with either half of it, the one nearer the stage's centre first. Allocates nothing. One thread calls at a time.
class FollowedPerson {
 public:
  /// `settings` as the CloudBuilder has them: where the stage's centre is.
  explicit FollowedPerson(const CloudSettings& settings) : centre_(settings.stage_x, settings.stage_z) {}

  /// For CloudBuilder::build() of the observation at `time`; holds until the next call.
  Followed at(double time);
  /// The Estimator has to start over before its step with that observation: it is the first with another half, or with the whole again.
  bool start_over() const { return stage_ != Stage::follows && stage_ != Stage::settled; }
  /// After each step of the Estimator. False: the result is one of two people at once, or of nobody, and is not to be told.
  bool remember(const FitResult& result, const Observation& observation);
  /// The next person is another one.
  void forget();

 private:
  enum class Stage : std::uint8_t {
    follows,
    first_half,  // the next frame is tried with it
    second_half,
    whole,    // with all, since neither half is a person: somebody in a chair, say
    settled,  // and that is what there is
  };
  bool halve(const Observation& observation);
  bool doubtful(const FitResult& result, const Observation& observation) const;

  Eigen::Vector2f centre_;
  std::array<Followed::Bone, kBones> bones_;
  Points3 joints_ = Points3::Zero(), velocity_ = Points3::Zero();
  double seen_ = 0;  ///< time of the joints
  bool known_ = false, last_found_ = false, crowded_ = false;
  Stage stage_ = Stage::follows;
  std::array<Eigen::Vector2f, 2> halves_;  ///< x, z
  double whole_left_ = 0;                  ///< of the cloud, by the body that was fitted to all of it: EnergyTerms::cloud_to_model
};

}  // namespace booth::fit
