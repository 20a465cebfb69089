// Boards are turned towards the middle between two cameras, as a person would hold them, and tilted a little at random.
#include "tests/fit/calibrate/board_booth.hpp"

#include <cmath>

namespace booth::tests {

using namespace fit::calibrate;

Rigid looking(const Eigen::Vector3d& from, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - from).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized(), y = z.cross(x);
  Rigid out;
  out.rotation << x, y, z;
  out.translation = from;
  return out;
}

Lens kinect_lens() { return {512, 424, 365.5, 365.5, 254.9, 205.4, {0.09, -0.27, 0.001, -0.0008, 0.09}}; }

namespace {

bool inside(const Lens& lens, const Eigen::Vector2d& p) { return p.x() > 4 && p.y() > 4 && p.x() < lens.width - 5 && p.y() < lens.height - 5; }

}  // namespace

CalibrationInput show_boards(const BoardBoothSettings& settings, BoardBooth& truth, const Move* move) {
  std::mt19937 random(settings.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto noise = [&](double sigma) { return sigma * normal(random); };
  // In an order of our own: that in which arguments are evaluated is the compiler's, and another one on Arm.
  const auto across = [&](double x, double y) {
    const double dy = y * uniform(random), dx = x * uniform(random);
    return Eigen::Vector2d(dx, dy);
  };
  const auto around = [&](double x, double y, double z) {
    const double dz = z * uniform(random), dy = y * uniform(random), dx = x * uniform(random);
    return Eigen::Vector3d(dx, dy, dz);
  };
  CalibrationInput in;
  const double half = settings.side / 2;
  truth = {};
  for (const auto& [name, x, y] :
       {std::tuple{"front-left", half, half}, {"back-left", -half, half}, {"back-right", -half, -half}, {"front-right", half, -half}}) {
    in.names.emplace_back(name);
    in.lenses.push_back(kinect_lens());
    in.expected.push_back(looking({x, y, 1.6}, {0, 0, 0.95}));
    // Nobody hangs a camera exactly where the plan has it.
    const Eigen::Vector3d at = Eigen::Vector3d(x, y, 1.6) + around(0.1, 0.1, 0.1);
    truth.booth_from_camera.push_back(looking(at, {0.1 * uniform(random), 0.1 * uniform(random), 0.9}));
    truth.depth.push_back({noise(0.002), 0.01 * uniform(random)});
  }
  const Board real{settings.square};
  in.views = settings.views + settings.on_floor;
  for (int v = 0; v < in.views; ++v) {
    Rigid board;
    if (v < settings.views) {
      const double heading = EIGEN_PI / 2 * (v % 4) + 0.35 * uniform(random);
      const Eigen::Vector3d out(std::cos(heading), std::sin(heading), 0.25 + 0.3 * uniform(random));
      const Eigen::Vector3d z = out.normalized(), x = Eigen::Vector3d::UnitZ().cross(z).normalized(), y = z.cross(x);
      board.rotation << x, y, z;
      board.rotation = board.rotation * rotation_by(around(0.25, 0.25, 0.25));
      board.translation = Eigen::Vector3d(0, 0, 1.1) + around(0.5, 0.5, 0.4);
    }
    truth.booth_from_board.push_back(board);
    for (int c = 0; c < 4; ++c) {
      const auto k = static_cast<std::size_t>(c);
      const Rigid& place = move != nullptr && move->camera == c && v >= move->view ? move->booth_from_camera : truth.booth_from_camera[k];
      const Rigid camera = place.inverse(), pose = camera * board;
      if (pose.rotation.col(2).dot(pose.translation.normalized()) > -0.4) continue;  // from behind or too flat
      Sighting s;
      s.view = v, s.camera = c;
      std::vector<Eigen::Vector2d> pixels;
      for (int id = 0; id < Board::kCorners; ++id) {
        const Eigen::Vector2d pixel = in.lenses[k].project(pose * real.corner(id));
        if (!inside(in.lenses[k], pixel)) continue;
        s.corner.push_back(id);
        const double dy = noise(settings.corner_noise), dx = noise(settings.corner_noise);
        pixels.emplace_back(pixel.x() + dx, pixel.y() + dy);
      }
      if (s.corner.size() < 12) continue;
      s.pixel.resize(2, static_cast<Eigen::Index>(pixels.size()));
      for (std::size_t i = 0; i < pixels.size(); ++i) s.pixel.col(static_cast<Eigen::Index>(i)) = pixels[i];
      for (int i = 0; i < 60; ++i) {
        const Eigen::Vector2d on_board = across(0.45 * real.width(), 0.45 * real.height());
        const Eigen::Vector3d p = pose * Eigen::Vector3d(on_board.x(), on_board.y(), 0);
        s.depth.push_back({p.x() / p.z(), p.y() / p.z(), truth.depth[k].read(p.z()) + noise(settings.depth_noise)});
      }
      in.sightings.push_back(std::move(s));
    }
  }
  in.room.resize(4);
  for (int c = 0; c < 4; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const Rigid camera = truth.booth_from_camera[k].inverse();
    for (int i = 0; i < 4000; ++i) {
      // Floor, one wall, and a person's worth of points above the floor.
      const Eigen::Vector2d on_floor = across(2, 2);
      Eigen::Vector3d p(on_floor.x(), on_floor.y(), 0);
      if (i % 4 == 1) p = {-2.5, 2 * uniform(random), 1 + uniform(random)};
      if (i % 4 == 2) p = {0.3 * uniform(random), 0.3 * uniform(random), 0.9 + 0.9 * uniform(random)};
      const Eigen::Vector3d q = camera * p;
      if (q.z() < 0.5 || !inside(in.lenses[k], in.lenses[k].project(q))) continue;
      in.room[k].push_back({q.x() / q.z(), q.y() / q.z(), truth.depth[k].read(q.z()) + noise(0.005)});
    }
  }
  return in;
}

}  // namespace booth::tests
