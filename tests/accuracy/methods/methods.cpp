// The product finds the person by itself; the comparators are told where to begin.
#include "tests/accuracy/methods/methods.hpp"

#include <stdexcept>

#include "tests/accuracy/methods/estimator_method.hpp"
#include "tests/accuracy/report/plan.hpp"

namespace booth::accuracy {
namespace {

void fit_booth(const Trial& t, const std::string& case_name, Samples& out) {
  const auto estimator = make_estimator(t.subjects, fit::Preset::booth, choice_of(t.subject.sex()));
  const fit::FitResult& result = estimator->fit(t.observation);
  record(out, case_name, "booth", "found", "percent", result.state == fit::FitState::lost ? 0 : 100);
  add_errors(fitted_body(*estimator, result), t.subject, t.truth, case_name, "booth", out);
}

/// Ten frames of the same cloud: each swarm starts about the solution before it, as published.
void fit_paper(const Trial& t, const std::string& case_name, Samples& out) {
  constexpr std::uint64_t kFrames = 10;
  const auto estimator = make_estimator(t.subjects, fit::Preset::paper, choice_of(t.subject.sex()));
  const fit::PoseVector start = comparator_start(estimator->model(), t.observation.cloud, t.truth[4]);
  fit::Observation frame = t.observation;
  const fit::FitResult* result = &estimator->fit(frame, &start);
  add_errors(fitted_body(*estimator, *result), t.subject, t.truth, case_name + ", first swarm", "paper", out);
  for (std::uint64_t k = 1; k < kFrames; ++k) {
    stop_if_requested();
    frame.frame = k;
    frame.time = static_cast<double>(k) / 30;
    result = &estimator->step(frame);
  }
  add_errors(fitted_body(*estimator, *result), t.subject, t.truth, case_name, "paper", out);
}

}  // namespace

const std::vector<std::string>& method_names() {
  static const std::vector<std::string> names{"booth", "paper"};
  return names;
}

void fit_and_compare(const std::string& method, const Trial& trial, const std::string& case_name, Samples& out) {
  if (method == "booth") return fit_booth(trial, case_name, out);
  if (method == "paper") return fit_paper(trial, case_name, out);
  throw std::invalid_argument("the method '" + method + "' is not known");
}

}  // namespace booth::accuracy
