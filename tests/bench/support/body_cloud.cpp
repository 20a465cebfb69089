// Points by area: triangles in proportion to their size, uniform within each.
#include "tests/bench/support/body_cloud.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "daemon/io/model_file.hpp"

namespace booth::bench {

fit::Cloud surface_cloud(const fit::BodyModel& model, const fit::ShapeVector& beta, const fit::PoseVector& q, int points, float noise, unsigned seed) {
  fit::Vertices v, normals;
  model.posed(beta, q, v);
  const fit::Faces& faces = model.data().faces;
  fit::vertex_normals(v, faces, normals);
  std::vector<double> area;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const auto t = faces.col(f);
    area.push_back(static_cast<double>((v.col(t[1]) - v.col(t[0])).cross(v.col(t[2]) - v.col(t[0])).norm()));
  }
  std::mt19937 random(seed);
  std::discrete_distribution<int> pick(area.begin(), area.end());
  std::uniform_real_distribution<float> uniform;
  std::normal_distribution<float> gauss;
  fit::Cloud cloud(points);
  while (cloud.size < points) {
    const auto t = faces.col(pick(random));
    const float root = std::sqrt(uniform(random)), b = root * (1 - uniform(random)), a = 1 - root, c = 1 - a - b;
    const Eigen::Vector3f p = a * v.col(t[0]) + b * v.col(t[1]) + c * v.col(t[2]);
    cloud.push(p + noise * Eigen::Vector3f(gauss(random), gauss(random), gauss(random)), normals.col(t[0]), 0);
  }
  return cloud;
}

Subject load_subject() {
  const auto models = daemon::find_models();
  Subject s{daemon::load_body_model(models / "men.npz"), daemon::load_pose_prior(models / "pose.npz"), {}, fit::PoseVector::Zero()};
  s.beta = fit::ShapeVector::Zero(s.model.shape_count());
  for (int k = 0; k < 5; ++k) s.beta[k] = k % 2 ? -0.7 : 0.9;
  s.q = s.prior.exemplars.col(0);
  s.q[0] = 0.1, s.q[1] = 0.93, s.q[2] = -0.2, s.q[4] = 0.4;
  s.q[fit::dof_index("lhumerus_rz")] = 0.6, s.q[fit::dof_index("rradius_rx")] = 0.8, s.q[fit::dof_index("lfemur_rx")] = -0.5;
  return s;
}

}  // namespace booth::bench
