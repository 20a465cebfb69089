// Options of `boothctl fit`, and the way from files to files.
#include "daemon/ctl/fit_verb.hpp"
#include "daemon/ctl/seed_option.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <iostream>
#include <optional>
#include <stdexcept>

#include "daemon/ctl/fit_input.hpp"
#include "daemon/ctl/fit_report.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/seed_option.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/glb_file.hpp"
#include "daemon/io/model_file.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "fit/detail/detail_layer.hpp"

namespace booth::daemon {
namespace {

struct Options {
  std::vector<std::filesystem::path> clouds;
  std::string model = "auto", preset = "booth", units = "m", up = "z";
  std::filesystem::path cameras, initial, out = ".", models;
  std::uint64_t seed = 1;
  int threads = 2;
  bool detail = false, clothed = false, json = false;
};

std::unique_ptr<fit::Estimator> make_estimator(const Options& options, fit::EstimatorSettings settings) {
  const auto folder = find_models(options.models);
  const bool paper = options.preset == "paper";
  const auto load = [&](const char* sex) -> std::shared_ptr<const fit::BodyModel> {
    if (options.model != "auto" && options.model != sex) return nullptr;
    const auto path = folder / (std::string(sex) + ".npz");
    return std::make_shared<const fit::BodyModel>(paper ? load_body_model_paper(path) : load_body_model(path));
  };
  auto prior = std::make_shared<const fit::PosePrior>(load_pose_prior(folder / "pose.npz"));
  settings.preset = paper ? fit::Preset::paper : fit::Preset::booth;
  settings.sex = options.model == "men" ? fit::SexChoice::men : options.model == "women" ? fit::SexChoice::women : fit::SexChoice::automatic;
  settings.threads = options.threads;
  settings.seed = options.seed;
  return std::make_unique<fit::Estimator>(load("men"), load("women"), std::move(prior), settings);
}

/// The detail layer on a fitted body.
struct Detail {
  fit::DetailLayer layer;
  DetailSummary summary;

  Detail(const fit::BodyModel& model, const fit::Observation& observation, const fit::FitResult& result) : layer(model) {
    layer.fit(observation, result.beta, result.q);
    summary.cloud_to_model = layer.distances(observation.cloud, result.beta, result.q);
    int seen = 0;
    for (int v = 0; v < model.vertex_count(); ++v) {
      if (!layer.seen(v)) continue;
      ++seen;
      summary.mean += std::abs(layer.offsets()[v]);
      summary.largest = std::max(summary.largest, std::abs(layer.offsets()[v]));
    }
    summary.mean /= std::max(1, seen);
    summary.seen = static_cast<double>(seen) / model.vertex_count();
  }
};

void write_results(const Options& options, UpAxis up, const fit::Estimator& estimator, const fit::FitResult& result, const Detail* detail,
                   const std::string& json) {
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) throw std::runtime_error("cannot make the folder " + options.out.string() + ": " + error.message());
  const fit::BodyModel& model = estimator.model();
  const fit::Points3 joints = model.rest_joints(result.beta);
  fit::Vertices normals, rest, posed;
  model.shaped(result.beta, rest);
  if (detail) detail->layer.apply(rest, rest);
  model.pose_mesh(rest, joints, result.q, posed);
  fit::vertex_normals(posed, model.data().faces, normals);
  write_ply(options.out / "body.ply", {posed, &normals, &model.data().faces}, up, "boothctl fit, model " + model.data().version);
  write_glb(options.out / "body.glb", {model, rest, joints, result.q});
  write_file_atomically(options.out / "fit.json", json);
}

void run(const Options& options) {
  if (options.clothed && options.preset == "paper")
    throw std::runtime_error("--clothed needs preset booth; the published energy pulls the body to the clothes");
  const UpAxis up = options.up == "y" ? UpAxis::y : UpAxis::z;
  say_step("reading");
  const FitInput input = read_fit_input(options.clouds, {.units = *units_from_name(options.units), .up = up});
  std::vector<Eigen::Vector3f> viewpoints;
  if (!options.cameras.empty()) viewpoints = read_viewpoints(options.cameras, up);
  fit::PoseVector initial;
  if (!options.initial.empty()) initial = read_initial_pose(options.initial);
  fit::EstimatorSettings settings;
  settings.clothed = options.clothed;
  const auto estimator = make_estimator(options, settings);

  say_step("fitting");
  const auto begin = std::chrono::steady_clock::now();
  fit::Observation observation(settings.cloud_capacity);
  fit::CloudReport report;
  if (!fit::build_unorganised(input.points, input.normals, viewpoints, {}, observation, report))
    throw std::runtime_error(std::string("no person in the input: ") + fit::describe(report.outcome));
  observation.floor_known = input.floor_known;
  observation.floor_height = input.floor_height;
  const fit::FitResult& result = estimator->fit(observation, options.initial.empty() ? nullptr : &initial);
  const auto elapsed_ms = [&] { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count(); };
  if (const std::string why = refusal(result); !why.empty()) throw std::runtime_error(why);
  std::optional<Detail> detail;
  if (options.detail) {
    say_step("detail");
    detail.emplace(estimator->model(), observation, result);
  }
  const double total_ms = elapsed_ms();

  FitContext context;
  context.preset = options.preset;
  context.seed = options.seed;
  context.threads = options.threads;
  context.up = up;
  context.viewpoints = viewpoints.size();
  context.total_ms = total_ms;
  for (const auto& file : options.clouds) context.files.push_back(file.string());
  context.points = observation.cloud.size;
  context.dropped = input.dropped;
  context.notes = input.notes;
  context.floor_points = input.floor_points;
  context.clothed = options.clothed;
  if (detail) context.detail = detail->summary;
  const std::string json = fit_json(result, estimator->model(), context);
  write_results(options, up, *estimator, result, detail ? &*detail : nullptr, json);

  for (const std::string& note : input.notes) std::cerr << "note: " << note << "\n";
  for (const std::string& warning : warnings(result, viewpoints.size(), options.clothed)) std::cerr << "warning: " << warning << "\n";
  if (options.json)
    std::cout << json;
  else
    std::cout << fmt::format("{}, {} points, cloud to body {:.1f} mm mean, {:.1f} mm p95{}, {:.0f} ms\nwrote {}, {}, {}\n", fit::to_string(result.sex),
                             observation.cloud.size, 1000 * result.cloud_to_model.mean, 1000 * result.cloud_to_model.p95,
                             detail ? fmt::format("; with detail {:.1f} mm mean, {:.1f} mm p95", 1000 * detail->summary.cloud_to_model.mean,
                                                  1000 * detail->summary.cloud_to_model.p95)
                                    : "",
                             total_ms, (options.out / "fit.json").string(), (options.out / "body.ply").string(), (options.out / "body.glb").string());
}

}  // namespace

void add_fit_verb(CLI::App& boothctl) {
  CLI::App* verb = boothctl.add_subcommand("fit", "One person's body and pose from point clouds or meshes of one moment");
  auto options = std::make_shared<Options>();
  verb->add_option("clouds", options->clouds, "PLY, OBJ, PCD or XYZ files")->required();
  verb->add_option("--model", options->model, "Body model")->check(CLI::IsMember({"men", "women", "auto"}))->capture_default_str();
  verb->add_option("--preset", options->preset, "Way of fitting: ours, or as published")->check(CLI::IsMember({"booth", "paper"}))->capture_default_str();
  verb->add_option("--cameras", options->cameras, "calibration.toml: where the points were seen from");
  verb->add_option("--init", options->initial, "JSON with the 36 entries of q to begin with");
  verb->add_option("--units", options->units, "Units of the files")->check(CLI::IsMember({"m", "cm", "mm", "auto"}))->capture_default_str();
  verb->add_option("--up", options->up, "Axis of the files that points up")->check(CLI::IsMember({"z", "y"}))->capture_default_str();
  as_seed(verb->add_option("--seed", options->seed, "Of the random numbers: the same seed gives the same result"));
  verb->add_option("--threads", options->threads, "Workers; the result does not depend on them")->check(CLI::Range(1, 256))->capture_default_str();
  verb->add_option("--out", options->out, "Folder for fit.json, body.ply and body.glb")->capture_default_str();
  verb->add_option("--models", options->models, "Folder of the body models");
  verb->add_flag("--detail", options->detail, "Add what no shape space holds: folds, hair, shoes and clothes, as an offset of each vertex");
  verb->add_flag("--clothed", options->clothed, "The points are clothes: find the body under them");
  verb->add_flag("--json", options->json, "Print fit.json");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
