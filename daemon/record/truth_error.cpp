// Joints against joints in every frame; surfaces against each other, both ways, in some.
#include "daemon/record/truth_error.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "fit/body/surface_distance.hpp"

namespace booth::daemon {
namespace {

constexpr std::size_t kSurfaceStride = 10, kMostSurfaceFrames = 300;

Eigen::VectorXf areas(const fit::Vertices& vertices, const fit::Faces& faces) {
  Eigen::VectorXf out = Eigen::VectorXf::Zero(vertices.cols());
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3f a = vertices.col(faces(0, f)), b = vertices.col(faces(1, f)), c = vertices.col(faces(2, f));
    const float third = (b - a).cross(c - a).norm() / 6;
    for (int i = 0; i < 3; ++i) out(faces(i, f)) += third;
  }
  return out;
}

double mean_distance(const fit::Vertices& from, const Eigen::VectorXf& weight, const fit::SurfaceDistance& to) {
  double sum = 0, total = 0;
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    sum += static_cast<double>(weight(i)) * static_cast<double>(to.distance(from.col(i)));
    total += static_cast<double>(weight(i));
  }
  return total > 0 ? sum / total : 0;
}

}  // namespace

TruthError truth_error(const std::vector<FrameRecord>& frames, const SessionModels& models, const hal::GroundTruth& truth) {
  TruthError out;
  std::vector<double> main_errors;
  std::vector<double> sum(kRecordJoints, 0.0);
  double settled_sum = 0;
  std::uint64_t settled_count = 0;
  std::vector<const FrameRecord*> seen;
  for (const FrameRecord& frame : frames) {
    if (frame.person == PersonState::lost) continue;
    const auto t = truth.at(hal::MonotonicTime(hal::Nanoseconds(frame.captured_ns)));
    if (!t) continue;
    seen.push_back(&frame);
    std::array<double, kRecordJoints> error{};
    for (std::size_t j = 0; j < kRecordJoints; ++j) {
      const auto& a = frame.joints[j];
      const auto& b = t->joints[j];
      error[j] = std::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
      sum[j] += error[j];
    }
    for (const int j : fit::main_joints()) {
      main_errors.push_back(error[static_cast<std::size_t>(j)]);
      if (frame.body_accepted) {
        settled_sum += main_errors.back();
        ++settled_count;
      }
    }
  }
  out.frames = seen.size();
  if (seen.empty()) return out;
  for (double e : main_errors) out.joint_mean += e;
  out.joint_mean /= static_cast<double>(main_errors.size());
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(0.95 * static_cast<double>(main_errors.size()))) - 1;
  std::nth_element(main_errors.begin(), main_errors.begin() + rank, main_errors.end());
  out.joint_p95 = main_errors[static_cast<std::size_t>(rank)];
  out.joint_mean_settled = settled_count ? settled_sum / static_cast<double>(settled_count) : 0;
  for (double& s : sum) {
    s /= static_cast<double>(seen.size());
    out.joint_mean_all += s / kRecordJoints;
  }
  out.per_joint_mean = sum;

  // The surfaces.
  const auto& truth_faces = truth.faces();
  if (truth_faces.empty()) return out;
  fit::Faces faces(3, static_cast<Eigen::Index>(truth_faces.size()));
  for (std::size_t f = 0; f < truth_faces.size(); ++f) faces.col(static_cast<Eigen::Index>(f)) << truth_faces[f][0], truth_faces[f][1], truth_faces[f][2];
  const std::size_t stride = std::max(kSurfaceStride, (seen.size() + kMostSurfaceFrames - 1) / kMostSurfaceFrames);
  std::unique_ptr<fit::SurfaceDistance> true_surface;
  std::array<std::unique_ptr<fit::SurfaceDistance>, 2> fitted_surface;
  fit::Vertices fitted, actual;
  for (std::size_t i = 0; i < seen.size(); i += stride) {
    const FrameRecord& frame = *seen[i];
    const fit::BodyModel* model = models.of(frame.sex);
    const auto points = truth.surface(hal::MonotonicTime(hal::Nanoseconds(frame.captured_ns)));
    if (!model || points.empty() || frame.shape_count > model->shape_count()) continue;
    actual.resize(3, static_cast<Eigen::Index>(points.size()));
    // Into the CMU frame, in which models are posed.
    for (std::size_t v = 0; v < points.size(); ++v) actual.col(static_cast<Eigen::Index>(v)) << points[v][1], points[v][2], points[v][0];
    const fit::ShapeVector beta = Eigen::Map<const Eigen::VectorXd>(frame.beta.data(), frame.shape_count);
    model->posed(beta, Eigen::Map<const fit::PoseVector>(frame.q.data()), fitted);
    auto& fitted_distance = fitted_surface[static_cast<std::size_t>(frame.sex)];
    if (!fitted_distance) fitted_distance = std::make_unique<fit::SurfaceDistance>(model->data().faces, model->vertex_count());
    if (!true_surface) true_surface = std::make_unique<fit::SurfaceDistance>(faces, static_cast<int>(points.size()));
    fitted_distance->set(fitted);
    true_surface->set(actual);
    out.fitted_to_truth += mean_distance(fitted, areas(fitted, model->data().faces), *true_surface);
    out.truth_to_fitted += mean_distance(actual, areas(actual, faces), *fitted_distance);
    ++out.surface_frames;
  }
  if (out.surface_frames > 0) {
    out.fitted_to_truth /= static_cast<double>(out.surface_frames);
    out.truth_to_fitted /= static_cast<double>(out.surface_frames);
    out.surface_mean = 0.5 * (out.fitted_to_truth + out.truth_to_fitted);
  }
  return out;
}

}  // namespace booth::daemon
