// Every way of finding a body from one observation that the study compares.
#pragma once

#include <string>
#include <vector>

#include "tests/accuracy/booth/errors.hpp"

namespace booth::accuracy {

struct Trial {
  const Subjects& subjects;
  const Subject& subject;
  const fit::Observation& observation;
  const fit::PoseVector& truth;
};

/// booth, paper, scape, icp.
const std::vector<std::string>& method_names();

/// Fits with the method, adds its errors (add_errors()) under the case, and returns the fitted vertices.
fit::Vertices fit_and_compare(const std::string& method, const Trial& trial, const std::string& case_name, Samples& out);

}  // namespace booth::accuracy
