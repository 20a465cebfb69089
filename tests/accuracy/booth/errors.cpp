// Areas are those of the true resting body, so that every method's vertices weigh the same.
#include "tests/accuracy/booth/errors.hpp"

#include <Eigen/Geometry>
#include <string>

#include "fit/body/surface_distance.hpp"

namespace booth::accuracy {
namespace {

Eigen::VectorXd vertex_areas(const fit::Vertices& v, const fit::Faces& faces) {
  Eigen::VectorXd area = Eigen::VectorXd::Zero(v.cols());
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const auto t = faces.col(f);
    const double third = static_cast<double>((v.col(t[1]) - v.col(t[0])).cross(v.col(t[2]) - v.col(t[0])).norm()) / 6;
    for (int k = 0; k < 3; ++k) area[t[k]] += third;
  }
  return area;
}

}  // namespace

double main_joint_error(const fit::Points3& joints, const fit::Points3& truth) {
  double sum = 0;
  for (const int j : fit::main_joints()) sum += (joints.col(j) - truth.col(j)).norm();
  return sum / static_cast<double>(fit::main_joints().size());
}

std::vector<float> surface_distances(const fit::Vertices& fitted, const Subject& subject, const fit::PoseVector& truth) {
  fit::SurfaceDistance surface(subject.model->data().faces, subject.model->vertex_count());
  surface.set(subject.surface(truth));
  std::vector<float> out(static_cast<std::size_t>(fitted.cols()));
  for (Eigen::Index i = 0; i < fitted.cols(); ++i) out[static_cast<std::size_t>(i)] = surface.distance(fitted.col(i));
  return out;
}

void add_errors(const FittedBody& fitted, const Subject& subject, const fit::PoseVector& truth, std::string_view case_name, std::string_view method,
                Samples& out) {
  constexpr double kCm = 100;
  const fit::Vertices vertices = subject.surface(truth);
  const Eigen::VectorXd area = vertex_areas(subject.body->rest, subject.model->data().faces);
  const std::vector<float> to_surface = surface_distances(fitted.vertices, subject, truth);
  Tally &vertex = out.at(case_name, method, kToVertex, "cm"), &surface = out.at(case_name, method, kToSurface, "cm");
  Tally &vertex_plain = out.at(case_name, method, std::string(kToVertex) + ", unweighted", "cm"),
        &surface_plain = out.at(case_name, method, std::string(kToSurface) + ", unweighted", "cm");
  for (Eigen::Index i = 0; i < vertices.cols(); ++i) {
    const double v = kCm * static_cast<double>((fitted.vertices.col(i) - vertices.col(i)).norm());
    const double s = kCm * static_cast<double>(to_surface[static_cast<std::size_t>(i)]);
    vertex.add(v, area[i]), surface.add(s, area[i]);
    vertex_plain.add(v), surface_plain.add(s);
  }
  for (Tally* t : {&vertex, &surface, &vertex_plain, &surface_plain}) t->count();
  if (!fitted.has_joints) return;
  const fit::Points3 joints = subject.joints(truth), vectors = subject.bone_vectors();
  Tally &joint = out.at(case_name, method, kJoints, "cm"), &bone = out.at(case_name, method, kBones, "cm");
  for (const int j : fit::main_joints()) joint.add(kCm * (fitted.joints.col(j) - joints.col(j)).norm());
  for (int b = 1; b < fit::kBones; ++b) bone.add(kCm * std::abs(fitted.bone_lengths[b] - vectors.col(b).norm()));
  joint.count(), bone.count();
}

}  // namespace booth::accuracy
