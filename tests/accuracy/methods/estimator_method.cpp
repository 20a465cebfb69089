// Settings that every table shares.
#include "tests/accuracy/methods/estimator_method.hpp"

namespace booth::accuracy {

std::unique_ptr<fit::Estimator> make_estimator(const Subjects& subjects, fit::Preset preset, fit::SexChoice sex, fit::EstimatorSettings settings) {
  const daemon::FitModels& models = preset == fit::Preset::paper ? subjects.paper_models() : subjects.models();
  settings.preset = preset;
  settings.sex = sex;
  settings.threads = 1;
  return std::make_unique<fit::Estimator>(models.men, models.women, models.prior, settings);
}

fit::SexChoice choice_of(fit::Sex sex) { return sex == fit::Sex::men ? fit::SexChoice::men : fit::SexChoice::women; }

FittedBody fitted_body(const fit::Estimator& estimator, const fit::FitResult& result) {
  FittedBody out;
  out.vertices = estimator.posed_vertices();
  out.has_joints = true;
  out.joints = result.joints;
  out.bone_lengths = estimator.model().bone_vectors(result.beta).colwise().norm().transpose();
  return out;
}

fit::PoseVector comparator_start(const fit::BodyModel& model, const fit::Cloud& cloud, double heading) {
  fit::PoseVector q = model.rest_pose();
  q.head<3>().setZero();
  q[4] = heading;
  fit::Vertices v;
  model.posed(fit::ShapeVector::Zero(model.shape_count()), q, v);
  const Eigen::Vector3d centre = (v * model.vertex_area()).cast<double>() / static_cast<double>(model.vertex_area().sum());
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (int i = 0; i < cloud.size; ++i) centroid += Eigen::Vector3d(cloud.x[i], cloud.y[i], cloud.z[i]);
  q.head<3>() = centroid / std::max(1, cloud.size) - centre;
  return q;
}

}  // namespace booth::accuracy
