// The product finds the person by itself; the comparators are told where to begin.
#include "tests/accuracy/methods/methods.hpp"

#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "tests/accuracy/icp/articulated_icp.hpp"
#include "tests/accuracy/methods/estimator_method.hpp"
#include "tests/accuracy/report/plan.hpp"
#include "tests/accuracy/scape/scape_fit.hpp"

namespace booth::accuracy {
namespace {

fit::Vertices fit_booth(const Trial& t, const std::string& case_name, Samples& out) {
  const auto estimator = make_estimator(t.subjects, fit::Preset::booth, choice_of(t.subject.sex()));
  const fit::FitResult& result = estimator->fit(t.observation);
  record(out, case_name, "booth", "found", "percent", result.state == fit::FitState::lost ? 0 : 100);
  add_errors(fitted_body(*estimator, result), t.subject, t.truth, case_name, "booth", out);
  return estimator->posed_vertices();
}

/// Ten frames of the same cloud: each swarm starts about the solution before it, as published.
fit::Vertices fit_paper(const Trial& t, const std::string& case_name, Samples& out) {
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
  return estimator->posed_vertices();
}

/// Trained when it is first asked for.
const ScapeModel& scape_of(const Subjects& subjects, fit::Sex sex) {
  static std::mutex mutex;
  static std::map<std::pair<const Subjects*, fit::Sex>, std::unique_ptr<ScapeModel>> trained;
  const std::lock_guard lock(mutex);
  auto& model = trained[{&subjects, sex}];
  const daemon::FitModels& models = subjects.models();
  if (!model) model = std::make_unique<ScapeModel>(sex == fit::Sex::men ? *models.men : *models.women, *models.prior);
  return *model;
}

/// A surface without a skeleton: no joints, no bones.
fit::Vertices fit_scape_baseline(const Trial& t, const std::string& case_name, Samples& out) {
  const fit::PoseVector start = comparator_start(*t.subject.model, t.observation.cloud, t.truth[4]);
  FittedBody body;
  body.vertices = fit_scape(scape_of(t.subjects, t.subject.sex()), t.observation.cloud, start).vertices;
  add_errors(body, t.subject, t.truth, case_name, "scape", out);
  return body.vertices;
}

fit::Vertices fit_icp_baseline(const Trial& t, const std::string& case_name, Samples& out) {
  const fit::BodyModel& model = *t.subject.model;
  const fit::PoseVector q = fit_articulated_icp(model, t.observation.cloud, comparator_start(model, t.observation.cloud, t.truth[4]));
  FittedBody body;
  const fit::ShapeVector mean = fit::ShapeVector::Zero(model.shape_count());
  model.posed(mean, q, body.vertices);
  fit::Kinematics kin;
  fit::forward_kinematics(q, model.bone_vectors(mean), kin);
  body.has_joints = true;
  body.joints = kin.joint;
  body.bone_lengths = model.bone_vectors(mean).colwise().norm().transpose();
  add_errors(body, t.subject, t.truth, case_name, "icp", out);
  return body.vertices;
}

}  // namespace

const std::vector<std::string>& method_names() {
  static const std::vector<std::string> names{"booth", "paper", "scape", "icp"};
  return names;
}

fit::Vertices fit_and_compare(const std::string& method, const Trial& trial, const std::string& case_name, Samples& out) {
  if (method == "booth") return fit_booth(trial, case_name, out);
  if (method == "paper") return fit_paper(trial, case_name, out);
  if (method == "scape") return fit_scape_baseline(trial, case_name, out);
  if (method == "icp") return fit_icp_baseline(trial, case_name, out);
  throw std::invalid_argument("the method '" + method + "' is not known");
}

}  // namespace booth::accuracy
