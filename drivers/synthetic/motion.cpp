// Evaluating a motion between its frames and putting it on the stage.
#include "drivers/synthetic/motion.hpp"

#include <algorithm>
#include <cmath>

namespace booth::drivers {
namespace {

/// Triangle wave that is the identity on [0, radius]: beyond it the path turns back through the centre.
double fold(double r, double radius) {
  const double u = std::fmod(r + radius, 4 * radius);
  return u <= 2 * radius ? u - radius : 3 * radius - u;
}

}  // namespace

fit::PoseVector Motion::at(double t) const {
  const long count = static_cast<long>(frames.size());
  if (count == 1) return frames[0];
  const long period = cyclic ? count : 2 * (count - 1);
  const double position = std::max(0.0, t) * rate;
  const double whole = std::floor(position);
  const double u = position - whole;
  const long index = static_cast<long>(std::fmod(whole, static_cast<double>(period)));
  const auto frame = [&](long i) -> const fit::PoseVector& {
    i = (i + period) % period;
    return frames[static_cast<std::size_t>(cyclic || i < count ? i : period - i)];
  };
  const double a = u * (-0.5 + u * (1 - 0.5 * u)), b = 1 + u * u * (-2.5 + 1.5 * u), c = u * (0.5 + u * (2 - 1.5 * u)), d = u * u * (-0.5 + 0.5 * u);
  return a * frame(index - 1) + b * frame(index) + c * frame(index + 1) + d * frame(index + 2);
}

double lowest_foot(const fit::PoseVector& q, const Contact& contact) {
  fit::Kinematics kin;
  fit::forward_kinematics(q, contact.bone_vectors, kin);
  double low = 1e9;
  for (const auto& p : contact.soles) low = std::min(low, kin.joint(1, fit::start_joint(p.bone)) + kin.rotation[p.bone].row(1).dot(p.offset));
  if (contact.soles.empty())
    for (const char* name : {"lankle", "lfoot_end", "ltoe_end", "rankle", "rfoot_end", "rtoe_end"}) low = std::min(low, kin.joint(1, fit::joint_index(name)));
  return low;
}

void place_on_stage(Motion& motion, const Contact& contact, const PlacementOptions& options) {
  if (options.keep_path) return;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (auto& q : motion.frames) {
    q.head<3>() *= options.leg_scale;
    centre += Eigen::Vector2d(q[0], q[2]);
  }
  centre /= static_cast<double>(motion.frames.size());
  double low = 1e9;
  for (auto& q : motion.frames) {
    const Eigen::Vector2d p = Eigen::Vector2d(q[0], q[2]) - centre;
    const double r = p.norm();
    const double scale = r > options.stage_radius ? fold(r, options.stage_radius) / r : 1;
    q[0] = scale * p.x();
    q[2] = scale * p.y();
    low = std::min(low, lowest_foot(q, contact));
  }
  for (auto& q : motion.frames) q[1] -= low;
}

}  // namespace booth::drivers
