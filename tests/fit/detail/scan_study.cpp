// booth-scan-study: how near bodies come to people that the model does not hold, with and without the detail layer. A command, not a test.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <iostream>

#include "daemon/io/fit_picture.hpp"
#include "daemon/io/model_file.hpp"
#include "daemon/io/png_image.hpp"
#include "fit/body/surface_distance.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "fit/detail/detail_layer.hpp"
#include "fit/estimator.hpp"
#include "tests/support/dressed_person.hpp"

namespace booth::tests {
namespace {

struct Options {
  std::vector<int> bodies{3, 21, 40, 50, 66, 85};
  std::vector<std::string> poses{"a", "arms-up", "stride"};
  std::vector<std::string> outfits{"bare", "tight", "loose"};
  std::string source = "scan";  // or camera
  bool clothed = false;
  std::vector<std::string> missing;  ///< each a part, several joined by +, or front, back, none: a scan of each
  int frames = 1, points = 100000;
  bool layer = true;
  std::filesystem::path pictures;
};

struct Row {
  double plain = 0, detail = 0, detail_p95 = 0, under = 0, signed_under = 0, waist = 0, joints = 0, fit_ms = 0, detail_ms = 0;
  double seen_worst = 0, missing_mean = 0;
  int said = 0, missing = 0, falsely = 0;  ///< missing joints that were said to be inferred, of how many; seen ones that were, too
};

/// What a scan of `pattern` (parts joined by +) lacks.
ScanRequest scan_without(const std::string& pattern, const DressedPerson& person) {
  ScanRequest out;
  for (std::size_t at = 0; at <= pattern.size() && pattern != "none" && !pattern.empty();) {
    const std::size_t end = std::min(pattern.find('+', at), pattern.size());
    const std::string part = pattern.substr(at, end - at);
    const auto heading = static_cast<float>(person.q[fit::dof_index("root_ry")]);
    if (part == "front" || part == "back")
      out.side = (part == "front" ? 1.0f : -1.0f) * Eigen::Vector3f(std::sin(heading), 0, std::cos(heading));  // what is left
    else
      out.missing |= bones_missing(part);
    at = end + 1;
  }
  return out;
}

double now_ms() { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

void draw(const std::filesystem::path& file, const DressedPerson& person, const fit::Cloud& cloud, const fit::Vertices& body, const fit::Vertices& detailed) {
  Eigen::Matrix3Xf points(3, cloud.size);
  for (int i = 0; i < cloud.size; ++i)
    points.col(i) << cloud.x[static_cast<std::size_t>(i)], cloud.y[static_cast<std::size_t>(i)], cloud.z[static_cast<std::size_t>(i)];
  std::vector<daemon::Picture> row;
  const daemon::SceneStyle style{.from = {0.6f, 0.2f, 1}, .metres_high = 2.1f};
  const auto& faces = person.model->data().faces;
  const auto one = [&](const fit::Vertices& v, const fit::Faces* f, const char* text) {
    const std::array<daemon::SceneItem, 1> items{daemon::SceneItem{v, f}};
    row.push_back(daemon::draw_scene(items, text, style));
  };
  one(person.outer, &person.outer_faces, "truth");
  one(points, nullptr, "points");
  one(body, &faces, "body");
  one(detailed, &faces, "with detail");
  daemon::write_png(file, daemon::Picture::beside(row));
}

Row measure(const Options& options, int body, const std::string& pose, Outfit outfit, const std::string& pattern) {
  const auto seed = static_cast<std::uint64_t>(body);
  const DressedPerson person = dress({.body = body, .pose = pose, .heading = 40.0 * (body % 9), .outfit = outfit, .seed = seed});
  const auto folder = daemon::find_models();
  auto men = std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "men.npz"));
  auto women = std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "women.npz"));
  auto prior = std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz"));
  fit::EstimatorSettings settings;
  settings.clothed = options.clothed;
  fit::Estimator estimator(men, women, prior, settings);
  Row row;
  fit::Observation scan(settings.cloud_capacity);
  std::unique_ptr<CameraView> cameras;
  const fit::Observation* observation = &scan;
  const double begin = now_ms();
  if (options.source == "scan") {
    fit::CloudReport report;
    const Eigen::Matrix3Xf points = [&] {
      ScanRequest request = scan_without(pattern, person);
      request.without_arm = pattern.empty() && body % 3 == 0;
      request.seed = seed;
      request.points = options.points;
      return scan_of(person, request);
    }();
    fit::build_unorganised(points, Eigen::Matrix3Xf(3, 0), {}, {}, scan, report);
  } else {
    cameras = std::make_unique<CameraView>("kinect2", seed);
    cameras->look(person.outer, person.outer_faces, 0);
    observation = &cameras->observation();
  }
  const double built = now_ms();
  const fit::FitResult& result = estimator.fit(*observation);
  row.fit_ms = now_ms() - built;
  const double fitted = now_ms();
  fit::DetailLayer layer(estimator.model(), {});
  if (options.layer) layer.fit(*observation, result.beta, result.q);
  for (int frame = 1; frame < options.frames && cameras; ++frame) {
    cameras->look(person.outer, person.outer_faces, static_cast<std::uint64_t>(frame));
    layer.add(cameras->observation(), result.beta, result.q);
  }
  row.detail_ms = now_ms() - fitted;
  fit::Vertices rest, detailed;
  estimator.model().shaped(result.beta, rest);
  layer.apply(rest, detailed);
  estimator.model().pose_mesh(detailed, estimator.model().rest_joints(result.beta), result.q, detailed);

  // Against the noiseless outer surface where cameras saw it: the cloud itself where it is a scan.
  row.plain = result.cloud_to_model.mean;
  const auto with = layer.distances(observation->cloud, result.beta, result.q);
  row.detail = with.mean, row.detail_p95 = with.p95;
  if (cameras) {
    fit::CloudReport report;
    fit::Observation truth(20000);
    fit::build_unorganised(scan_of(person, {.points = 20000, .noise = 0, .holes = 0}), Eigen::Matrix3Xf(3, 0), {}, {}, truth, report);
    row.detail = layer.distances(truth.cloud, result.beta, result.q).mean;
    row.detail_p95 = layer.distances(truth.cloud, result.beta, result.q).p95;
  }
  // The body under what is worn: vertices of the fitted body against the bare skin.
  fit::SurfaceDistance skin(person.model->data().faces, person.model->vertex_count());
  fit::Vertices normals;
  fit::vertex_normals(person.skin, person.model->data().faces, normals);
  skin.set(person.skin, normals);
  const fit::Vertices& fitted_vertices = estimator.posed_vertices();
  double sum = 0, outside = 0;
  for (Eigen::Index v = 0; v < fitted_vertices.cols(); ++v) {
    const Eigen::Vector3f p = fitted_vertices.col(v);
    const fit::SurfaceFoot foot = skin.closest(p, 0.3f, Eigen::Vector3f::Zero(), 0);
    if (foot.face < 0) continue;
    Eigen::Vector3f at = Eigen::Vector3f::Zero(), n = Eigen::Vector3f::Zero();
    for (int k = 0; k < 3; ++k) {
      const int corner = person.model->data().faces(k, foot.face);
      at += foot.weights[k] * person.skin.col(corner), n += foot.weights[k] * normals.col(corner);
    }
    sum += static_cast<double>(foot.distance);
    outside += static_cast<double>(n.normalized().dot(p - at));
  }
  row.under = sum / static_cast<double>(fitted_vertices.cols());
  row.signed_under = outside / static_cast<double>(fitted_vertices.cols());
  for (const auto& m : fit::measure(estimator.model(), result.beta))
    if (m.name == "waist_girth") row.waist = m.value - person.measures[static_cast<std::size_t>(fit::Measure::waist_girth)];
  for (const int j : fit::main_joints()) row.joints += (result.joints.col(j) - person.joints.col(j)).norm() / static_cast<double>(fit::main_joints().size());
  // A joint is missing when the bone that ends there is.
  const std::uint32_t missing = pattern.empty() ? (body % 3 == 0 ? bones_missing("rforearm") : 0u) : scan_without(pattern, person).missing;
  for (const int j : fit::main_joints()) {
    const double error = (result.joints.col(j) - person.joints.col(j)).norm();
    const bool said = result.visibility[static_cast<std::size_t>(j)] == fit::JointVisibility::inferred;
    if ((missing >> j & 1u) != 0)
      row.missing_mean += error, ++row.missing, row.said += said;
    else
      row.seen_worst = std::max(row.seen_worst, error), row.falsely += said;
  }
  if (row.missing > 0) row.missing_mean /= row.missing;
  if (!options.pictures.empty()) {
    std::filesystem::create_directories(options.pictures);
    draw(options.pictures / fmt::format("{}-{}-{}{}.png", body, pose, to_string(outfit), pattern.empty() ? "" : "-" + pattern), person, observation->cloud,
         fitted_vertices, detailed);
  }
  (void)begin;
  return row;
}

int run(const Options& options) {
  fmt::print("source {}, clothed {}, frames {}; millimetres\n", options.source, options.clothed, options.frames);
  fmt::print("{:>5} {:<11} {:<6} {:<14} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>10} {:>7} {:>7}\n", "body", "pose", "outfit", "missing",
             "plain", "detail", "p95", "under", "signed", "waist", "joints", "worst", "missing", "said", "fit ms", "layer");
  const std::vector<std::string> patterns = options.missing.empty() ? std::vector<std::string>{""} : options.missing;
  for (const std::string& outfit : options.outfits)
    for (const std::string& pattern : patterns) {
      Row mean;
      int n = 0;
      const auto print = [&](const std::string& who, const std::string& pose, const Row& r, double share) {
        fmt::print("{:>5} {:<11} {:<6} {:<14} {:7.2f} {:7.2f} {:7.2f} {:7.2f} {:7.2f} {:7.1f} {:7.1f} {:7.1f} {:7.1f} {:>4}/{:<3}+{:<2} {:7.0f} {:7.0f}\n", who,
                   pose, outfit, pattern, 1e3 * r.plain * share, 1e3 * r.detail * share, 1e3 * r.detail_p95 * share, 1e3 * r.under * share,
                   1e3 * r.signed_under * share, 1e3 * r.waist * share, 1e3 * r.joints * share, 1e3 * r.seen_worst * share, 1e3 * r.missing_mean * share,
                   r.said, r.missing, r.falsely, r.fit_ms * share, r.detail_ms * share);
        std::fflush(stdout);
      };
      for (const int body : options.bodies)
        for (const std::string& pose : options.poses) {
          const Outfit o = outfit == "bare" ? Outfit::bare : outfit == "tight" ? Outfit::tight : Outfit::loose;
          const Row r = measure(options, body, pose, o, pattern);
          print(std::to_string(body), pose, r, 1);
          mean.plain += r.plain, mean.detail += r.detail, mean.detail_p95 += r.detail_p95, mean.under += r.under, mean.signed_under += r.signed_under;
          mean.waist += std::abs(r.waist), mean.joints += r.joints, mean.seen_worst += r.seen_worst, mean.missing_mean += r.missing_mean;
          mean.said += r.said, mean.missing += r.missing, mean.falsely += r.falsely, mean.fit_ms += r.fit_ms, mean.detail_ms += r.detail_ms;
          ++n;
        }
      print("mean", "", mean, 1.0 / n);
    }
  fmt::print(
      "plain and detail: the cloud from the body without and with its detail; under: the body from the bare truth; waist: in the means, of absolute values; "
      "worst: of the "
      "seen joints; missing: mean of those without points; said: how many of these are called inferred, + how many of the seen ones\n");
  return 0;
}

}  // namespace
}  // namespace booth::tests

int main(int argc, char** argv) {
  booth::tests::Options options;
  CLI::App app{"Bodies and detail layers of people with folds, hair, shoes and clothes; every number is remade by the same options."};
  app.add_option("--bodies", options.bodies, "Of the set-aside bodies, 1 to 90")->capture_default_str();
  app.add_option("--poses", options.poses, "a, arms-up, stride, sit, or typical-N: the N-th exemplar of the pose prior")->capture_default_str();
  app.add_option("--outfits", options.outfits, "bare, tight, loose")->capture_default_str();
  app.add_option("--source", options.source, "scan or camera")->check(CLI::IsMember({"scan", "camera"}))->capture_default_str();
  app.add_flag("--clothed", options.clothed, "Fit the body under clothes");
  app.add_option(
      "--missing", options.missing,
      "Parts that the scanner missed, joined by +: head, arms, legs, l or r before forearm, arm, foot, shank, leg; front or back: only that side was "
      "scanned; none. A scan of each. Without the option every third body lacks its right forearm");
  app.add_option("--points", options.points, "Of a scan")->capture_default_str();
  app.add_flag("--layer,!--no-layer", options.layer, "The detail layer is fitted too (default)");
  app.add_option("--frames", options.frames, "Moments that the layer averages (camera)")->capture_default_str();
  app.add_option("--pictures", options.pictures, "Folder for pictures");
  try {
    app.parse(argc, argv);
    return booth::tests::run(options);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::cerr << "booth-scan-study: " << e.what() << "\n";
    return 1;
  }
}
