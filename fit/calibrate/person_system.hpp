// What a person who is followed says of the cameras: where each of them really stands, and when it really looked.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "fit/body/poser.hpp"
#include "fit/calibrate/rigid.hpp"
#include "fit/cloud/point_grid.hpp"
#include "fit/estimator.hpp"

namespace booth::fit::calibrate {

struct PersonSystemSettings {
  static constexpr int kMostCameras = 8;
  int cameras = 4;                 ///< 1 to kMostCameras; views of the observations
  Eigen::Vector3d pivot{0, 1, 0};  ///< CMU frame, metres: steps turn about it; about the middle of a person on the stage
  int samples = 240;               ///< points of each camera in a moment, at most 400
  int stride = 3;                  ///< every so many tracked frames are a moment
  double independent = 20;         ///< as how many independent measurements of `sigma` a camera's points of a moment count
  double sigma = 0.01;             ///< metres
  double turn_sigma = 0.05;        ///< radians, metres, seconds: what is known of a camera beforehand
  double shift_sigma = 0.2, late_sigma = 0.02;
};

/// What the points of one camera say against those of the majority.
struct CameraSays {
  Vector6 step = Vector6::Zero();  ///< CMU frame: how its points have to be turned (rad, about the pivot) and shifted (m) to agree; so has the camera
  double displacement = 0;         ///< metres, root mean square over a person, of what `step` does to points
  double deviation = 0;            ///< metres, what the covariance expects `displacement` to be where the camera has not moved
  double late = 0;                 ///< seconds by which its time stamps lie behind its exposures, against the mean of all cameras
  double late_deviation = 0;       ///< seconds, one standard deviation
  double moments = 0;              ///< in which it saw the person, forgotten ones left out
  double missed = 0;               ///< share of the moments in which it should have seen the person, and saw nothing of it where the others do
};

/// Normal equations over all cameras' steps and delays, the person's shape, and each moment's pose. The pose is eliminated moment by moment (Schur complement),
/// so that the pull of each camera on the fitted pose is no bias; the shape is a common unknown with its own prior. Fixed memory: everything is allocated by
/// the constructor, the other functions allocate nothing and throw nothing. One thread at a time. Derivation: docs/design/drift.md.
class PersonSystem {
 public:
  /// One of the models may be null. Throws std::invalid_argument when both are, or a setting is out of its range.
  PersonSystem(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, const PersonSystemSettings& settings);

  /// One fitted frame; call for every frame, in order. True when a moment was added: its frame is the one before, since a velocity needs frames on both sides.
  bool observe(const Observation& observation, const FitResult& result);
  /// Keeps so much (0 to 1) of what was learnt.
  void forget(double share);
  /// Somebody else will come: what is known of the shape goes, what it says of the cameras stays.
  void new_person();
  /// Forgets everything.
  void clear();
  /// Adds what another system of the same settings has learnt from the same person.
  void add(const PersonSystem& other);

  /// Cameras that the system has learnt of from now on: the best estimate is also where later points look for their place on the body.
  void solve();
  const std::array<CameraSays, PersonSystemSettings::kMostCameras>& cameras() const { return says_; }

  std::size_t memory_bytes() const;

 private:
  static constexpr int kShape = 12, kPerCamera = 7;
  static constexpr int kCommon = kShape + 1;  ///< and how far everything seen lies outside the body
  static constexpr int kMostUnknowns = kPerCamera * PersonSystemSettings::kMostCameras + kCommon;
  static constexpr int kLocal = kDofs + kPerCamera + kCommon + 1;  ///< of one point's row, its constant last
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostUnknowns, kMostUnknowns>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostUnknowns, 1>;
  struct Sample {
    Eigen::Vector3f p, n;
    std::uint8_t camera;
  };
  struct Seen {
    bool valid = false, expected = false;  ///< gave a picture; the person should be in it
    int points = 0;
    float time_offset = 0;
    Eigen::Vector3f centre = Eigen::Vector3f::Zero();
  };

  int camera_unknown(int camera) const { return kPerCamera * camera; }
  int common_unknown() const { return kPerCamera * settings_.cameras; }
  void take_samples(const Observation& observation, const FitResult& result);
  bool add_moment(const PoseVector& after, double time_after);
  int add_points(const Poser& poser, const PoseVector& speed, int camera);
  void eliminate_pose();
  void add_priors(Matrix& a) const;
  void judge(const Vector& x, const Matrix& covariance);

  const PersonSystemSettings settings_;
  std::vector<std::shared_ptr<const BodyModel>> models_;
  struct Body {
    std::unique_ptr<Poser> poser;
    ShapeVector shaped;
  };
  std::array<Body, 2> body_;  ///< by sex; no poser: no model
  PointGrid grid_;

  // The frame that waits for the one after it, and the one before it.
  std::vector<Sample> samples_;
  std::array<Seen, PersonSystemSettings::kMostCameras> seen_{};
  bool pending_ = false, have_last_ = false;
  Sex sex_ = Sex::men, last_sex_ = Sex::men;
  PoseVector q_, before_, last_;
  ShapeVector beta_;
  double time_before_ = 0, last_time_ = 0;
  int skipped_ = 0;

  std::array<std::array<float, kLocal * kLocal>, PersonSystemSettings::kMostCameras> gram_{};
  Eigen::Matrix<double, kDofs, kDofs> pose_;
  Eigen::Matrix<double, kDofs, Eigen::Dynamic, 0, kDofs, kMostUnknowns> cross_, solved_;
  Eigen::Matrix<double, kDofs, 1> pose_gradient_;
  Matrix information_, moment_, work_;
  Vector gradient_, moment_gradient_;
  std::array<double, PersonSystemSettings::kMostCameras> moments_{}, expected_{}, missed_{};
  std::array<CameraSays, PersonSystemSettings::kMostCameras> says_{};
};

/// Metres, root mean square over the points of a standing person around the pivot, by which a step moves them.
double displacement_of(const Vector6& step);

}  // namespace booth::fit::calibrate
