// A tape measure for bodies: girths, breadths and lengths by the definitions of the ANSUR II survey, read off the resting mesh.
#pragma once

#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "fit/body/body_model.hpp"

namespace booth::fit {

/// Vertices of the template that measures hang on. Left ones; the right is BodyModelData::mirror_vertex of it.
enum class Landmark : int { nipple, navel, buttock, crotch, acromion, trochanterion, count };
inline constexpr int kLandmarks = static_cast<int>(Landmark::count);

enum class Measure : int {
  stature,  ///< top of the head above the lowest vertex
  mass,     ///< volume times kBodyDensity
  volume,
  chest_girth,       ///< horizontal, level of the nipples, without the arms
  waist_girth,       ///< horizontal, level of the navel (omphalion)
  buttock_girth,     ///< horizontal, level of the buttocks' greatest protrusion
  thigh_girth,       ///< horizontal, left thigh at the gluteal fold, 2.5 cm below the crotch
  calf_girth,        ///< horizontal, greatest of the left calf
  shoulder_breadth,  ///< between the acromia
  arm_length,        ///< left acromion to elbow to wrist
  leg_length,        ///< left trochanterion above the lowest vertex
  crotch_height,
  count
};
inline constexpr int kMeasures = static_cast<int>(Measure::count);
inline constexpr double kBodyDensity = 1000;  ///< kg/m^3 of the skin's volume, lungs included

/// Girths are convex: the tape does not follow hollows. Units: "m", "kg", "m^3".
struct Measurement {
  std::string_view name;
  double value = 0;
  std::string_view unit;
  double sd = 0;  ///< standard deviation of the value about the person's own, by measure_with_sd(); 0 where nothing is claimed
};
std::string_view measure_name(Measure m);
std::string_view measure_unit(Measure m);

using MeasureValues = std::array<double, kMeasures>;

/// Measures any resting mesh on one topology. Immutable and thread-safe after construction.
class Measurer {
 public:
  /// Throws std::invalid_argument when the data has no landmarks or one of them is not a vertex.
  /// `data.mean` serves to tell left from right; joint_regressor and directions are not used.
  explicit Measurer(const BodyModelData& data);

  /// `rest`: 3 x V in the A-pose, y up, metres; `joints`: its resting joints in the same frame.
  MeasureValues measure(const Vertices& rest, const Points3& joints) const;

 private:
  using Edges = std::vector<std::pair<int, int>>;
  static double girth(const Vertices& rest, const Edges& edges, double height);

  Faces faces_;
  Eigen::VectorXi mirror_;
  std::array<int, kLandmarks> landmark_{};
  Edges trunk_;     // everything but the arms
  Edges left_leg_;  // left half without the arm
};

/// Covariance of shape coefficients; as many rows as beta has entries.
using ShapeMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxShape, kMaxShape>;

/// All measures of the resting body with shape `beta`; off the frame path (it allocates).
std::vector<Measurement> measure(const BodyModel& model, const ShapeVector& beta);
/// The same with standard deviations: the covariance of beta carried through the derivatives of each measure, the model's coefficients behind beta at their
/// population's spread, and what no coefficient explains. The interval value +- 1.645 sd is meant to hold the truth in 90 of 100 people; how that was
/// set and tested: docs/design/detail.md. An empty covariance: only the population's and the model's parts.
std::vector<Measurement> measure_with_sd(const BodyModel& model, const ShapeVector& beta, const ShapeMatrix& covariance);
/// What measure_with_sd() makes of a variance carried through the derivatives, and its inverse, for calibration.
double calibrated_measure_sd(Measure m, double propagated_variance);
double propagated_variance_of(Measure m, double calibrated_sd);
std::vector<Measurement> named(const MeasureValues& values);

}  // namespace booth::fit
