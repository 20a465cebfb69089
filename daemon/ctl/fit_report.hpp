// fit.json: everything a fit found, under the keys of docs/reference/fit-json.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/io/axes.hpp"
#include "fit/estimator.hpp"

namespace booth::daemon {

/// What the detail layer added.
struct DetailSummary {
  fit::DistanceStatistics cloud_to_model;  ///< of the cloud's points to the surface with detail
  double seen = 0;                         ///< fraction of the vertices whose offsets points have measured
  double mean = 0, largest = 0;            ///< of the offsets' sizes over those, m
};

struct FitContext {
  std::string preset;  ///< "booth" or "paper"
  std::uint64_t seed = 1;
  int threads = 1;
  UpAxis up = UpAxis::z;                 ///< the input's axes, which joints are given in
  std::size_t viewpoints = 0;            ///< cameras that were given
  double total_ms = 0;                   ///< preparing the cloud and fitting; reading files and models not counted
  std::vector<std::string> files;        ///< as they were given
  std::int64_t points = 0, dropped = 0;  ///< used; not finite
  std::vector<std::string> notes;        ///< what was changed in the input
  std::int64_t floor_points = 0;         ///< of the input, taken out
  bool clothed = false;
  std::optional<DetailSummary> detail;
};

/// A body was found, but it does not explain the points: they are no person's, or not one person's. One sentence, empty when all is well.
std::string refusal(const fit::FitResult& result);

/// One sentence for each reason to look twice at the result. `clothed`: points far outside the body are expected.
std::vector<std::string> warnings(const fit::FitResult& result, std::size_t viewpoints, bool clothed);

/// JSON text, ending in a newline. Lengths in metres, angles in radians.
std::string fit_json(const fit::FitResult& result, const fit::BodyModel& model, const FitContext& context);

}  // namespace booth::daemon
