// Where the study asks the estimator how sure it is of a measure.
#pragma once

#include <optional>
#include <string_view>

#include "fit/estimator.hpp"

namespace booth::accuracy {

/// Standard deviation of a measure in its own unit (m, kg, m^3); nothing while the estimator states none: its covariance of the shape is not published.
inline std::optional<double> measure_sd(const fit::FitResult&, std::string_view) { return std::nullopt; }

}  // namespace booth::accuracy
