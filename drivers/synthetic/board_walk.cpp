// Turned to the middle between two cameras, tilted and shifted at random.
#include "drivers/synthetic/board_walk.hpp"

#include <cmath>

namespace booth::drivers {

std::vector<fit::calibrate::Rigid> board_places(const BoardWalk& walk) {
  using fit::calibrate::Rigid;
  std::uint64_t state = walk.seed * 0x9e3779b97f4a7c15ull + 1;
  const auto any = [&state] {  // -1 to 1
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<double>(state >> 33) / 4294967296.0 * 4 - 1;
  };
  const auto bounded = [&any] { return std::fmod(any() + 1, 2.0) - 1; };
  std::vector<Rigid> out;
  for (int v = 0; v < walk.views; ++v) {
    const double heading = EIGEN_PI / 2 * (v % 4) + 0.2 * bounded();
    const Eigen::Vector3d z = Eigen::Vector3d(std::cos(heading), std::sin(heading), 0.25 + 0.25 * bounded()).normalized();
    const Eigen::Vector3d x = Eigen::Vector3d::UnitZ().cross(z).normalized();
    Rigid place;
    place.rotation << x, z.cross(x), z;
    place.rotation = place.rotation * fit::calibrate::rotation_by(0.15 * Eigen::Vector3d(bounded(), bounded(), 2 * bounded()));
    place.translation = Eigen::Vector3d(walk.reach * bounded(), walk.reach * bounded(), 1.1 + 0.35 * bounded());
    out.push_back(place);
  }
  if (walk.on_floor) out.push_back({});
  return out;
}

}  // namespace booth::drivers
