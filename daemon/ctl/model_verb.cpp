// Files in, fit::train in the middle, files and a table of figures out.
#include "daemon/ctl/model_verb.hpp"
#include "daemon/ctl/seed_option.hpp"
#include "daemon/ctl/verbs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/ctl/seed_option.hpp"
#include "daemon/io/ansur.hpp"
#include "daemon/io/makehuman.hpp"
#include "daemon/io/mocap_folder.hpp"
#include "daemon/io/model_file.hpp"
#include "daemon/io/npz.hpp"
#include "fit/body/measure.hpp"
#include "fit/train/pose_training.hpp"
#include "fit/train/shape_training.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using fit::Sex;

/// CAESAR's spreads, which a survey of soldiers does not have.
constexpr double kStatureSd[] = {0.077, 0.071}, kMassSd = 18.4;
/// Of over-represented dance every third frame counts.
constexpr int kDanceStride = 3;

/// Lines for a person who waits; silent when standard error is not a terminal.
class Progress {
 public:
  void operator()(const std::string& line) const {
    if (!isatty(STDERR_FILENO)) return;
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
    std::cerr << fmt::format("[{:6.1f} s] {}\n", elapsed.count(), line);
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

fit::train::Survey load_survey(const TrainShapeOptions& options, const fs::path& held_out, Sex sex) {
  const bool men = sex == Sex::men;
  fit::train::Survey survey;
  const auto aside = load_held_out_bodies(held_out, sex);
  auto all = load_ansur(options.ansur / (men ? "ansur2_male_subset.csv" : "ansur2_female_subset.csv"), sex);
  for (int subject : aside) {  // in the list's order
    const auto found = std::find_if(all.begin(), all.end(), [&](const auto& p) { return p.subject == subject; });
    if (found == all.end()) throw std::runtime_error(held_out.string() + ": subject " + std::to_string(subject) + " is not in the survey");
    survey.held_out.push_back(*found);
    all.erase(found);
  }
  if (survey.held_out.empty()) throw std::runtime_error(held_out.string() + ": sets no " + to_string(sex) + " aside");
  survey.training = std::move(all);
  survey.bodies = men ? options.men : options.women;
  survey.stature_sd = kStatureSd[men ? 0 : 1];
  survey.mass_sd = kMassSd;
  return survey;
}

int components_for(const Eigen::VectorXd& explained, double part) {
  for (Eigen::Index k = 0; k < explained.size(); ++k)
    if (explained[k] >= part) return static_cast<int>(k) + 1;
  return 0;
}

void report_shape(const fit::train::TrainedShape& t, std::ostream& out) {
  out << fmt::format("\n{}: {} bodies ({} drawn ones lay beyond the sliders' range), {} components; 95 % by {}, 15 explain {:.2f} %\n", to_string(t.model.sex),
                     t.bodies, t.rejected, t.model.directions.cols(), components_for(t.model.explained, 0.95),
                     100 * t.model.explained[std::min<Eigen::Index>(15, t.model.explained.size()) - 1]);
  out << fmt::format("  set-aside bodies: {:.2f} mm mean vertex distance to the kept components\n", 1e3 * t.held_out_surface);
  out << "  made against wanted (mean and worst |error|):";
  for (int i = 0; i < fit::train::kFittedMeasures; ++i) {
    const bool mass = fit::train::fitted_measure_name(i) == "mass";
    out << fmt::format(" {} {:.2f}/{:.2f} {},", fit::train::fitted_measure_name(i), t.error_mean[i] * (mass ? 1 : 100), t.error_worst[i] * (mass ? 1 : 100),
                       mass ? "kg" : "cm");
  }
  out << "\n  database (mean and standard deviation):";
  for (int i = 0; i < fit::kMeasures; ++i) {
    const auto m = static_cast<fit::Measure>(i);
    if (m == fit::Measure::volume) continue;
    const bool mass = m == fit::Measure::mass;
    const auto k = static_cast<std::size_t>(i);
    out << fmt::format(" {} {:.1f} +- {:.1f} {},", measure_name(m), t.measure_mean[k] * (mass ? 1 : 100), t.measure_sd[k] * (mass ? 1 : 100),
                       mass ? "kg" : "cm");
  }
  out << "\n  joint regressor on the set-aside bodies, mm (template-only in brackets):";
  for (int j = 0; j < fit::kJoints; ++j)
    out << fmt::format(" {} {:.1f} ({:.1f}),", fit::bones()[static_cast<std::size_t>(j)].end_joint, 1e3 * t.joint_residual[j],
                       1e3 * t.template_joint_residual[j]);
  out << fmt::format("\n  mean of all joints {:.2f} mm\n", 1e3 * t.joint_residual.mean());
}

}  // namespace

int run_model_train_shape(const TrainShapeOptions& options, std::ostream& out) {
  const Progress progress;
  const fs::path held_out = options.held_out.empty() ? options.out / "held_out_bodies.csv" : options.held_out;
  const auto men = load_survey(options, held_out, Sex::men), women = load_survey(options, held_out, Sex::women);
  const auto base = load_makehuman(options.makehuman);
  progress("base body read");
  fit::train::ShapeTrainingSettings settings;
  settings.seed = options.seed;
  settings.threads = std::clamp(options.threads, 1, 64);
  auto training = fit::train::train_shapes(base, men, women, settings, progress);

  const auto mesh = fit::train::inspect(training.mesh.average, training.mesh.faces);
  out << fmt::format("template: {} vertices, {} faces, closed, Euler number {}, edges {:.2f} cm (5 % {:.2f}, 95 % {:.2f})\n", mesh.vertices, mesh.faces,
                     mesh.euler(), 100 * mesh.edge_mean, 100 * mesh.edge_p05, 100 * mesh.edge_p95);
  std::vector<TestBody> bodies;
  for (auto* trained : {&training.men, &training.women}) {
    auto& model = trained->model;
    model.version = fmt::format("{}-{}-{}", to_string(model.sex), trained->bodies, options.seed);
    BodyModelExtras extras;
    extras.template_regressor = trained->template_regressor;
    extras.sigma = model.directions.colwise().norm().cast<double>() / std::sqrt(static_cast<double>(model.mean.cols()));
    extras.joint_residual = trained->joint_residual;
    extras.notes = fmt::format("{} bodies of a CC0 base mesh driven by ANSUR II measures, seed {}", trained->bodies, options.seed);
    save_body_model(options.out / fmt::format("{}.npz", to_string(model.sex)), model, extras);
    for (const auto& h : trained->held_out) {
      TestBody body{h.person.sex, h.person.subject, h.rest, h.rest_joints, {}};
      for (const auto& m : fit::named(h.measures)) body.measurements.emplace_back(m.name, m.value);
      bodies.push_back(std::move(body));
    }
    report_shape(*trained, out);
  }
  save_test_bodies(options.out / "test_bodies.npz", bodies);
  return 0;
}

int run_model_train_pose(const TrainPoseOptions& options, std::ostream& out) {
  const auto folder = load_motion_folder(options.motions, options.held_out.empty() ? options.out.parent_path() / "held_out_motions.csv" : options.held_out);
  std::vector<fit::train::MotionSegment> segments;
  int used = 0, aside = 0, excluded = 0;
  for (const auto& clip : folder.clips) {
    (clip.use == MotionUse::training ? used : clip.use == MotionUse::held_out ? aside : excluded) += clip.frames;
    if (clip.use == MotionUse::training) segments.push_back({clip.start, clip.frames, clip.motion_class == "dance" ? kDanceStride : 1});
  }
  fit::train::PoseTrainingSettings settings;
  settings.seed = options.seed;
  auto prior = fit::train::train_pose_prior(folder.q, segments, settings);
  prior.version = fmt::format("cmu-{}-{}", used, options.seed);
  save_pose_prior(options.out, prior);

  // Does the subspace hold motions that it has not seen?
  double total = 0, outside = 0, beyond = 0, angles = 0;
  for (const auto& clip : folder.clips) {
    if (clip.use != MotionUse::held_out) continue;
    for (int f = clip.start; f < clip.start + clip.frames; ++f) {
      const fit::PoseAngles q = folder.q.col(f).cast<double>().tail<fit::kPoseDofs>(), d = q - prior.mean;
      total += d.squaredNorm();
      outside += (d - prior.components * (prior.components.transpose() * d)).squaredNorm();
      beyond += ((q - prior.lower).array() < 0).count() + ((q - prior.upper).array() > 0).count();
      angles += fit::kPoseDofs;
    }
  }
  out << fmt::format("pose prior: {} frames (with mirror images {}), {} set aside, {} excluded; {} components, {} exemplars\n", used, 2 * used, aside, excluded,
                     prior.components.cols(), prior.exemplars.cols());
  if (total > 0)
    out << fmt::format("  set-aside motions: {:.2f} % of the variance inside the subspace, {:.3f} % of the angles beyond the limits\n",
                       100 * (1 - outside / total), 100 * beyond / angles);
  return 0;
}

int run_model_info(const ModelInfoOptions& options, std::ostream& out) {
  const NpzReader file(options.file);
  const std::string kind = file.text("kind");
  nlohmann::ordered_json info;
  info["file"] = options.file.string();
  info["kind"] = kind;
  if (kind == "boothd-body-model") {
    BodyModelExtras extras;
    const fit::BodyModel model(load_body_model_data(options.file, &extras));
    const auto& d = model.data();
    info["version"] = d.version;
    info["sex"] = to_string(d.sex);
    info["vertices"] = model.vertex_count();
    info["faces"] = d.faces.cols();
    info["components"] = model.shape_count();
    info["components_95"] = components_for(d.explained, 0.95);
    info["components_99"] = components_for(d.explained, 0.99);
    info["explained_15"] = d.explained[std::min<Eigen::Index>(15, d.explained.size()) - 1];
    info["explained_all"] = d.explained[d.explained.size() - 1];
    if (extras.joint_residual.size() == fit::kJoints) info["joint_residual_mean"] = extras.joint_residual.mean();
    const auto report = fit::train::inspect(d.mean, d.faces);
    info["closed"] = report.open_edges == 0 && report.overused_edges == 0;
    info["edge_mean"] = report.edge_mean;
    if (d.landmarks.size() == fit::kLandmarks)
      for (const auto& m : fit::measure(model, fit::ShapeVector())) info["mean_body"][std::string(m.name)] = m.value;
    info["notes"] = extras.notes;
  } else if (kind == "boothd-pose-prior") {
    const auto prior = load_pose_prior(options.file);
    info["version"] = prior.version;
    info["angles"] = fit::kPoseDofs;
    info["components"] = prior.components.cols();
    info["exemplars"] = prior.exemplars.cols();
    for (int d = fit::kRootDofs; d < fit::kDofs; ++d)
      info["limits"][std::string(fit::dof_name(d))] = {prior.lower[d - fit::kRootDofs], prior.upper[d - fit::kRootDofs], prior.speed_limit[d]};
  } else if (kind == "boothd-test-bodies") {
    const auto bodies = load_test_bodies(options.file);
    info["bodies"] = bodies.size();
    info["men"] = std::count_if(bodies.begin(), bodies.end(), [](const auto& b) { return b.sex == Sex::men; });
    info["vertices"] = bodies.front().rest.cols();
  } else {
    file.fail("kind", "is '" + kind + "'; expected boothd-body-model, boothd-pose-prior or boothd-test-bodies");
  }
  if (options.json) {
    out << info.dump(2) << "\n";
    return 0;
  }
  for (const auto& [key, value] : info.items()) {
    if (!value.is_object()) {
      out << fmt::format("{:<20} {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
      continue;
    }
    out << key << ":\n";
    for (const auto& [name, inner] : value.items()) out << fmt::format("  {:<18} {}\n", name, inner.dump());
  }
  return 0;
}

namespace {

// As the projects that publish them name their folders.
constexpr const char *kMakehumanFolder = "makehuman-cc0", *kAnsurFolder = "ansur2";

std::string holds_training_data(const std::string& folder) {
  for (const char* name : {kMakehumanFolder, kAnsurFolder}) {
    std::error_code ignored;
    if (!fs::is_directory(fs::path(folder) / name, ignored)) return fmt::format("{} has no folder {} in it", folder, name);
  }
  return {};
}

}  // namespace

void add_model_verbs(CLI::App& app) {
  auto* model = app.add_subcommand("model", "Train the body models and the pose prior, or say what is in a model file");
  model->require_subcommand(1);

  auto shape = std::make_shared<TrainShapeOptions>();
  auto* train_shape = model->add_subcommand("train-shape", "Make men.npz, women.npz and test_bodies.npz");
  auto* data = train_shape->add_option("DIR", shape->data, fmt::format("Folder with {} and {} in it: short for the next two", kMakehumanFolder, kAnsurFolder))
                   ->check(holds_training_data);
  auto* makehuman = train_shape->add_option("--makehuman", shape->makehuman, "Folder with base.obj, targets/ and rigs/ (CC0)")->check(CLI::ExistingDirectory);
  auto* ansur = train_shape->add_option("--ansur", shape->ansur, "Folder with the ANSUR II tables")->check(CLI::ExistingDirectory)->excludes(data);
  makehuman->excludes(data)->needs(ansur);
  ansur->needs(makehuman);
  train_shape->add_option("--out", shape->out, "Folder for the models")->required()->check(CLI::ExistingDirectory);
  train_shape->add_option("--held-out", shape->held_out, "List of bodies set aside (default: held_out_bodies.csv in --out)");
  train_shape->add_option("--men", shape->men, "Men in the database")->capture_default_str()->check(CLI::Range(32, 100000));
  train_shape->add_option("--women", shape->women, "Women in the database")->capture_default_str()->check(CLI::Range(32, 100000));
  as_seed(train_shape->add_option("--seed", shape->seed, "Seed of the random sliders"));
  train_shape->add_option("--threads", shape->threads, "Worker threads; the result does not depend on it")->capture_default_str()->check(CLI::Range(1, 64));
  train_shape->callback([shape] {
    if (!shape->data.empty()) {
      shape->makehuman = shape->data / kMakehumanFolder;
      shape->ansur = shape->data / kAnsurFolder;
    }
    if (shape->makehuman.empty()) throw CLI::RequiredError("DIR, or --makehuman and --ansur");
    run_model_train_shape(*shape, std::cout);
  });

  auto pose = std::make_shared<TrainPoseOptions>();
  auto* train_pose = model->add_subcommand("train-pose", "Make pose.npz from joint-angle sequences");
  train_pose->add_option("DIR", pose->motions, "Folder with train/q.npy and train/clips.csv")->required()->check(CLI::ExistingDirectory);
  train_pose->add_option("--out", pose->out, "File to write")->required();
  train_pose->add_option("--held-out", pose->held_out, "List of motions set aside (default: held_out_motions.csv beside --out)");
  as_seed(train_pose->add_option("--seed", pose->seed, "Seed of the clustering"));
  train_pose->callback([pose] { run_model_train_pose(*pose, std::cout); });

  auto about = std::make_shared<ModelInfoOptions>();
  auto* info = model->add_subcommand("info", "Say what is in a model file");
  info->add_option("FILE", about->file, "men.npz, women.npz, pose.npz or test_bodies.npz")->required()->check(CLI::ExistingFile);
  info->add_flag("--json", about->json, "Machine-readable");
  info->callback([about] { run_model_info(*about, std::cout); });
}

}  // namespace booth::daemon
