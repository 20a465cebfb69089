// One measured person and the sliders that make a body with these measures.
#pragma once

#include <optional>
#include <vector>

#include "fit/body/measure.hpp"
#include "fit/train/body_generator.hpp"
#include "fit/train/random.hpp"

namespace booth::fit::train {

/// What training uses of a row of ANSUR II. Metres, kilograms, years.
struct Person {
  int subject = 0;
  Sex sex = Sex::men;
  double age = 0;
  double stature = 0, mass = 0, chest = 0, waist = 0, buttock = 0, thigh = 0, calf = 0, trochanterion = 0,
         arm = 0;  ///< arm: acromion-radiale + radiale-stylion
};

inline constexpr int kFittedMeasures = 9;
using FittedMeasures = Eigen::Matrix<double, kFittedMeasures, 1>;
/// stature, mass, chest, waist, buttock, thigh, calf, trochanterion, arm.
FittedMeasures measures_of(const Person& p);
FittedMeasures fitted_measures(const MeasureValues& m);
std::string_view fitted_measure_name(int i);

/// Widens a survey of soldiers to the spread of civilians: stature and mass are moved away from the mean (mass about its regression on
/// stature), and the other measures follow along their regression on both within the survey.
class Widener {
 public:
  /// `mass_sd`, `stature_sd`: spreads to reach. Uses all of `survey`, which holds one sex.
  Widener(const std::vector<Person>& survey, double stature_sd, double mass_sd);
  Person widen(const Person& p) const;

 private:
  FittedMeasures mean_;
  double stature_gain_, mass_on_stature_, mass_gain_;
  Eigen::Matrix<double, kFittedMeasures, 2> slope_;  // of each measure on (stature, mass)
};

struct FittedBody {
  Stacked body;          ///< vertices and joints, root joint at the origin
  FittedMeasures error;  ///< made minus wanted
  /// False where the sliders' range ended before the person was reached.
  bool matches() const;
};

/// Draws what a tape does not tell (race, age, proportions, limbs, head, mild asymmetry ...) and then solves height, weight, muscle and nine
/// tape sliders for the person's measures by damped Gauss-Newton. Thread-safe.
class PersonFitter {
 public:
  PersonFitter(const BodyGenerator& generator, const Measurer& measurer);
  FittedBody fit(const Person& person, Random random) const;

 private:
  Sliders draw(const Person& person, Random& random) const;

  const BodyGenerator& generator_;
  const Measurer& measurer_;
  std::vector<int> tape_;  // indices of the nine tape sliders
};

}  // namespace booth::fit::train
