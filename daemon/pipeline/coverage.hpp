// When so little of a body was seen that somebody should be told: the one rule, and its sentence, of fits, recordings and the live booth.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>

namespace booth::daemon {

/// True when so little of the body was seen that the rest is inferred: from one camera, about half of it is. `fraction`: the part of the surface that points
/// explain; `viewpoints`: cameras that saw it, 0 where that is not known.
inline bool coverage_is_partial(double fraction, std::size_t viewpoints) {
  // Points of one side explain 50 to 60 % of the surface (what lies near a seen point counts as explained), points of all sides over 80 %.
  constexpr double kWhole = 0.7;
  return viewpoints == 1 || fraction < kWhole;
}

/// As `coverage` of fit.json and session.json has it.
inline const char* coverage_word(bool partial) { return partial ? "partial" : "full"; }

inline std::string partial_coverage_sentence(double fraction) {
  return "coverage: partial. The points show " + std::to_string(std::lround(100 * fraction)) + " % of the body; the rest is inferred and less certain";
}

}  // namespace booth::daemon
