// Turns a FitResult into JSON; nothing is computed here that the estimator has not found.
#include "daemon/ctl/fit_report.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/pipeline/coverage.hpp"
#include "fit/body/measure.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

Json distances(const fit::DistanceStatistics& d) { return {{"mean", d.mean}, {"median", d.median}, {"p95", d.p95}}; }

Json energies(const fit::EnergyTerms& e) {
  return {
      {"point", e.point},           {"plane", e.plane},   {"shape", e.shape},       {"bone", e.bone},  {"pose", e.pose}, {"cloud_to_model", e.cloud_to_model},
      {"free_space", e.free_space}, {"limits", e.limits}, {"temporal", e.temporal}, {"total", e.total}};
}

/// Standard deviation along the worst direction.
double worst_sd(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[2]));
}

}  // namespace

std::string refusal(const fit::FitResult& result) {
  // Far outside what any clothing, hair or noise does to a scan (a right fit of a bare body is at 2 to 4 mm), and well inside what a cube,
  // a wall or a body lying on its side (wrong axes) gives.
  constexpr double kFarAway = 0.05, kHardlyAny = 0.25;
  const double mean = result.cloud_to_model.mean;
  if (result.state == fit::FitState::lost || mean > kFarAway)
    return fmt::format("no person in the input: the best body lies {:.0f} mm from the points on average; are up axis (--up) and units (--units) right?",
                       1000 * mean);
  if (result.coverage < kHardlyAny) return fmt::format("no person in the input: the points show {:.0f} % of the best body", 100 * result.coverage);
  return {};
}

std::vector<std::string> warnings(const fit::FitResult& result, std::size_t viewpoints, bool clothed) {
  const double doubtful_mean = clothed ? 0.03 : 0.015, doubtful_tail = clothed ? 0.09 : 0.05;
  std::vector<std::string> out;
  if (coverage_is_partial(result.coverage, viewpoints)) out.push_back(partial_coverage_sentence(result.coverage));
  std::string unseen;
  for (int b = 0; b < fit::kBones; ++b)
    if ((result.unseen >> b & 1u) != 0) unseen += fmt::format("{}{}", unseen.empty() ? "" : ", ", fit::bones()[static_cast<std::size_t>(b)].name);
  if (!unseen.empty()) out.push_back(fmt::format("the points show nothing of {}: placed as is usual beside the rest, not measured", unseen));
  constexpr double kLies = 0.5;  // cosine between the trunk and the vertical
  const Eigen::Vector3d trunk = result.joints.col(fit::joint_index("head_base")) - result.joints.col(fit::joint_index("root"));
  if (trunk.y() < kLies * trunk.norm())
    out.push_back("the body lies, or its head is down: if the person stood, another axis of the file points up (--up y or --up z)");
  if (result.cloud_to_model.mean > doubtful_mean || result.cloud_to_model.p95 > doubtful_tail)
    out.push_back(fmt::format("the body explains the points poorly ({:.0f} mm mean, {:.0f} mm p95): a limb may be wrong, or something else is in the cloud",
                              1000 * result.cloud_to_model.mean, 1000 * result.cloud_to_model.p95));
  return out;
}

std::string fit_json(const fit::FitResult& result, const fit::BodyModel& model, const FitContext& context) {
  Json out;
  out["preset"] = context.preset;
  out["sex"] = fit::to_string(result.sex);
  out["model_version"] = model.data().version;
  out["seed"] = context.seed;
  out["threads"] = context.threads;
  out["frame"] = context.up == UpAxis::z ? "booth: x forward, y left, z up; metres" : "CMU: y up, z forward, x left; metres";
  out["q"] = std::vector<double>(result.q.data(), result.q.data() + result.q.size());
  out["beta"] = std::vector<double>(result.beta.data(), result.beta.data() + result.beta.size());

  const auto joints = file_from_cmu(result.joints, context.up);
  Json places = Json::object(), spread = Json::object(), seen = Json::object(), lengths = Json::object();
  const fit::Points3 vectors = model.bone_vectors(result.beta);
  for (int j = 0; j < fit::kJoints; ++j) {
    const fit::Bone& bone = fit::bones()[static_cast<std::size_t>(j)];
    const std::string joint(bone.end_joint);
    places[joint] = {joints(0, j), joints(1, j), joints(2, j)};
    spread[joint] = worst_sd(result.joint_covariance[static_cast<std::size_t>(j)]);
    seen[joint] = result.visibility[static_cast<std::size_t>(j)] == fit::JointVisibility::seen ? "seen" : "inferred";
    if (j > 0) lengths[std::string(bone.name)] = vectors.col(j).norm();
  }
  out["joints"] = places;
  out["joint_sd"] = spread;
  out["joint_visibility"] = seen;
  out["bone_lengths"] = lengths;

  Json measurements = Json::object();
  // Where the estimator gives no covariance of the shape (preset paper), no deviation can be claimed: null, not zero.
  const bool known = result.shape_covariance.rows() > 0;
  for (const fit::Measurement& m : fit::measure_with_sd(model, result.beta, result.shape_covariance))
    measurements[std::string(m.name)] = {{"value", m.value}, {"sd", known ? Json(m.sd) : Json()}, {"unit", m.unit}};
  out["measurements"] = measurements;

  const Json energy = energies(result.energy);
  Json terms = Json::array();
  for (const auto& [name, value] : energy.items())
    if (name != "total" && value.get<double>() != 0) terms.push_back(name);
  out["energy"] = energy;
  out["terms_active"] = terms;
  out["iterations"] = result.iterations;
  out["total_ms"] = context.total_ms;
  out["cloud_to_model"] = distances(result.cloud_to_model);
  out["model_to_cloud"] = distances(result.model_to_cloud);
  out["clothed"] = context.clothed;
  if (context.detail) {
    out["cloud_to_model_detail"] = distances(context.detail->cloud_to_model);
    out["detail"] = {{"seen_fraction", context.detail->seen}, {"mean_offset", context.detail->mean}, {"largest_offset", context.detail->largest}};
  }
  out["coverage"] = coverage_word(coverage_is_partial(result.coverage, context.viewpoints));
  out["coverage_fraction"] = result.coverage;
  out["warnings"] = warnings(result, context.viewpoints, context.clothed);
  out["input"] = {{"files", context.files},        {"points", context.points},         {"dropped", context.dropped},
                  {"floor", context.floor_points}, {"viewpoints", context.viewpoints}, {"notes", context.notes}};
  return out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace booth::daemon
