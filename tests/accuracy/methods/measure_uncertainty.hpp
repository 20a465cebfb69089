// Where the study asks the estimator for the body's measures, and how sure it is of them.
#pragma once

#include <optional>
#include <vector>

#include "fit/body/measure.hpp"
#include "fit/estimator.hpp"

namespace booth::accuracy {

/// With deviations where the estimator states a covariance of the shape, plain otherwise: the study runs on either.
template <class Result>
std::vector<fit::Measurement> stated_measures(const fit::BodyModel& model, const Result& result) {
  if constexpr (requires { measure_with_sd(model, result.beta, result.shape_covariance); }) {
    return measure_with_sd(model, result.beta, result.shape_covariance);
  } else {
    return fit::measure(model, result.beta);
  }
}

/// Standard deviation in the measure's own unit (m, kg, m^3); nothing where none is stated.
template <class Measurement>
std::optional<double> stated_sd(const Measurement& m) {
  if constexpr (requires { m.sd; }) {
    if (m.sd > 0) return m.sd;
  }
  return std::nullopt;
}

}  // namespace booth::accuracy
