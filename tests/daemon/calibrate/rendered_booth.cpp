// Cameras at the corners of a square, some centimetres and degrees beside their planned places.
#include "tests/daemon/calibrate/rendered_booth.hpp"

#include <random>

#include "drivers/synthetic/board_walk.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::tests {

RenderedBooth::RenderedBooth(double side, std::uint64_t seed, int views)
    : planned(drivers::camera_ring()), places(drivers::board_places({.views = views, .reach = side / 8, .seed = seed})) {
  std::mt19937_64 random(seed);
  const auto any = [&random] { return static_cast<double>(random() >> 11) / 4503599627370496.0 - 1; };
  for (auto& c : planned) {
    const double x = c.camera_to_world.translation[0] * side / 4, y = c.camera_to_world.translation[1] * side / 4;
    const Eigen::Vector3d from(x, y, 1.6), z = (Eigen::Vector3d(0, 0, 0.95) - from).normalized(), right = z.cross(Eigen::Vector3d::UnitZ()).normalized();
    fit::calibrate::Rigid pose;
    pose.rotation << right, z.cross(right), z;
    pose.translation = from;
    c.camera_to_world = daemon::transform_of(pose);
    pose.rotation = fit::calibrate::rotation_by(0.05 * Eigen::Vector3d(any(), any(), any())) * pose.rotation;
    pose.translation += 0.08 * Eigen::Vector3d(any(), any(), any());
    real.push_back(c);
    real.back().camera_to_world = daemon::transform_of(pose);
  }
  for (std::size_t i = 0; i < real.size(); ++i) {
    depth_offset.push_back(0.004 * (static_cast<double>(i) - 1.5));
    camera.emplace_back(real[i], static_cast<int>(i),
                        drivers::BoardViewSettings{.seed = seed, .depth_gain = 0.002 * any(), .depth_offset = depth_offset.back()});
  }
}

std::vector<hal::DepthFrame> RenderedBooth::look(int view, const std::function<void(drivers::ShownBoard&)>& change) {
  drivers::ShownBoard shown;
  shown.booth_from_board = places[static_cast<std::size_t>(view)];
  if (change) change(shown);
  std::vector<hal::DepthFrame> out;
  for (auto& c : camera) out.push_back(c.look(shown, static_cast<std::uint64_t>(view)));
  return out;
}

std::vector<daemon::ViewPicture> pictures_of(const std::vector<hal::DepthFrame>& frames) {
  std::vector<daemon::ViewPicture> out;
  for (const auto& f : frames) out.push_back({hal::to_int(f.camera), {512, 424, f.infrared}, {512, 424, f.depth}});
  return out;
}

}  // namespace booth::tests
