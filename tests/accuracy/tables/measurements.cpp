// Table measurements: girths, breadths and lengths of people the model has never seen, and whether the stated uncertainty covers the truth.
#include <fmt/format.h>

#include <cmath>

#include "tests/accuracy/booth/motion_run.hpp"
#include "tests/accuracy/methods/measure_uncertainty.hpp"
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {
namespace {

constexpr double kNinety = 1.6449;  // standard deviations on either side that hold 90 % of a normal distribution

bool is_girth(std::string_view name) { return name.ends_with("girth"); }

/// Error of one measure in the unit that a tailor reads: cm, kg or litres.
void add(Samples& out, const char* case_name, const fit::Measurement& found, double truth, const std::optional<double>& sd) {
  const double factor = found.unit == "m" ? 100 : found.unit == "m^3" ? 1000 : 1;
  const char* unit = found.unit == "m" ? "cm" : found.unit == "m^3" ? "litres" : "kg";
  record(out, case_name, "booth", found.name, unit, factor * std::abs(found.value - truth));
  const char* group = found.unit != "m" ? nullptr : is_girth(found.name) ? "all girths" : "all lengths";
  if (group) record(out, case_name, "booth", group, unit, factor * std::abs(found.value - truth));
  if (!sd) return;
  const double covered = std::abs(found.value - truth) <= kNinety * *sd ? 100 : 0;
  record(out, case_name, "booth", std::string(found.name) + ": truth within the stated 90 %", "percent", covered);
  record(out, case_name, "booth", "all measures: truth within the stated 90 %", "percent", covered);
}

Samples measure_one(const Subjects& subjects, int body, double seconds) {
  const Subject subject = subjects.get(body);
  Samples out;
  const auto compare = [&](const char* case_name, const Sighting& s) {
    for (const fit::Measurement& found : stated_measures(s.estimator->model(), *s.result))
      for (const auto& [name, truth] : subject.body->measurements)
        if (name == found.name) add(out, case_name, found, truth, stated_sd(found));
    record(out, case_name, "booth", "right sex", "percent", s.result->sex == subject.sex() ? 100 : 0);
  };
  const int last = static_cast<int>(seconds * 30) - 1;
  // Turns once before the cameras: all of the body is seen.
  follow(subjects, subject, {"turn", {}}, {.seconds = seconds, .seed = static_cast<std::uint64_t>(body)}, [&](const Sighting& s) {
    if (s.frame == 0 && s.result->state != fit::FitState::lost) compare("one frame", s);
    if (s.frame == last) compare("accepted body", s);
    return true;
  });
  return out;
}

}  // namespace

Plan plan_measurements(const Request& request) {
  Plan plan;
  const double seconds = request.short_form ? 1 : 3;
  plan.protocol = fmt::format(
      "Set-aside bodies turn on the stage before four cameras with Kinect v2 noise. Their measures by ANSUR II's definitions (`fit/body/measure.hpp`) are read "
      "off the fitted resting body after "
      "the first frame and after {:g} s, and compared with those of the true mesh by the same tape. The mean is the mean absolute error.",
      seconds);
  for (int body = 1; body <= request.subjects->count(); body += request.short_form ? 30 : 1)
    plan.units.push_back({fmt::format("test:{}", body), [subjects = request.subjects, body, seconds] { return measure_one(*subjects, body, seconds); }});
  plan.goals = {{"accepted body", "booth", "all girths", false, 1.5},
                {"accepted body", "booth", "all lengths", false, 1},
                {"accepted body", "booth", "all measures: truth within the stated 90 %", true, 90}};
  return plan;
}

}  // namespace booth::accuracy
