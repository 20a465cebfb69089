// The simulated camera's geometry against exact rays, and its noise against what the model says.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/optics.hpp"
#include "drivers/synthetic/scene.hpp"
#include "fit/body/surface_distance.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;

drivers::Person standing() {
  const auto body = capsule_body();
  fit::Vertices rest;
  body->shaped(fit::ShapeVector(), rest);
  const auto contact = drivers::contact_of(*body, rest, body->rest_joints(fit::ShapeVector()));
  return drivers::make_person("capsule", body, fit::ShapeVector(), drivers::motion_by_name("a-pose", 0, contact));
}

drivers::Source open(drivers::SceneSettings s, std::vector<drivers::Person> persons) {
  s.pace = drivers::Pace::fast;
  return drivers::make_scene(std::move(s), std::move(persons), std::make_shared<drivers::ManualClock>());
}

hal::DepthFrame first_frame(const drivers::Source& source, std::size_t camera = 0) {
  hal::DepthFrame frame;
  source.cameras[camera]->start();
  EXPECT_EQ(source.cameras[camera]->read(frame, 1s), hal::ReadStatus::frame);
  return frame;
}

Eigen::Vector3d world(const hal::CameraDescription& c, int u, int v, double metres) {
  const Eigen::Vector2d ray = drivers::undistorted_ray(c.intrinsics, u, v);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(c.camera_to_world.rotation.data()) * (metres * Eigen::Vector3d(ray.x(), ray.y(), 1)) +
         Eigen::Map<const Eigen::Vector3d>(c.camera_to_world.translation.data());
}

TEST(Optics, UndistortsWhatItDistorts) {
  const auto k = drivers::camera_ring()[0].intrinsics;
  for (int v = 0; v < k.height; v += 53)
    for (int u = 0; u < k.width; u += 51) {
      const Eigen::Vector2d ray = drivers::undistorted_ray(k, u, v), back = drivers::distort(k, ray.x(), ray.y());
      EXPECT_NEAR(back.x() * k.fx + k.cx, u, 1e-5);
      EXPECT_NEAR(back.y() * k.fy + k.cy, v, 1e-5);
    }
}

TEST(SyntheticCamera, SeesFloorAndWallsWhereTheyAre) {
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  const auto source = open(s, {});
  EXPECT_EQ(source.truth, nullptr);
  const auto frame = first_frame(source, 2);
  const auto& c = source.cameras[2]->description();
  int floor = 0, wall = 0;
  for (int v = 0; v < 424; v += 7)
    for (int u = 0; u < 512; u += 7) {
      const auto counts = frame.depth[static_cast<std::size_t>(v * 512 + u)];
      ASSERT_GT(counts, 0);
      const Eigen::Vector3d p = world(c, u, v, counts * 0.001);
      const double from_wall = 3 - std::max(std::abs(p.x()), std::abs(p.y()));
      EXPECT_LT(std::min(std::abs(p.z()), std::abs(from_wall)), 0.002) << u << " " << v;
      std::abs(p.z()) < std::abs(from_wall) ? ++floor : ++wall;
    }
  EXPECT_GT(floor, 100);
  EXPECT_GT(wall, 100);
}

TEST(SyntheticCamera, DrawsTheBodyOnItsTrueSurface) {
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  s.room_half_width = 0;
  s.floor = false;
  const auto source = open(s, {standing()});
  const auto frame = first_frame(source);
  const auto surface = source.truth->surface(frame.captured);
  fit::Vertices v(3, static_cast<Eigen::Index>(surface.size()));
  for (std::size_t i = 0; i < surface.size(); ++i) v.col(static_cast<Eigen::Index>(i)) = Eigen::Vector3f(surface[i].data());
  const auto& faces = source.truth->faces();
  int seen = 0;
  for (int y = 0; y < 424; y += 3)
    for (int x = 0; x < 512; x += 3) {
      const auto counts = frame.depth[static_cast<std::size_t>(y * 512 + x)];
      if (counts == 0) continue;
      ++seen;
      const Eigen::Vector3f p = world(source.cameras[0]->description(), x, y, counts * 0.001).cast<float>();
      float nearest = 1;
      for (const auto& f : faces) nearest = std::min(nearest, fit::triangle_distance(p, v.col(f[0]), v.col(f[1]), v.col(f[2])));
      EXPECT_LT(nearest, 0.003f) << x << " " << y;  // rounding to millimetres, and distortion inside a triangle
    }
  EXPECT_GT(seen, 600);
}

TEST(SyntheticCamera, NoiseHasTheSpreadThatTheModelSays) {
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  const auto truth = first_frame(open(s, {}));
  for (const double sigma : {0.005, 0.02}) {
    s.noise = drivers::NoiseModel::parse("gaussian:" + std::to_string(sigma));
    const auto noisy = first_frame(open(s, {}));
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < noisy.depth.size(); ++i) {
      const double d = (noisy.depth[i] - truth.depth[i]) * 0.001;
      sum += d;
      squares += d * d;
    }
    const double n = static_cast<double>(noisy.depth.size());
    EXPECT_NEAR(sum / n, 0, 0.0003);
    EXPECT_NEAR(std::sqrt(squares / n), sigma, 0.03 * sigma);
  }
}

TEST(SyntheticCamera, KinectNoiseGrowsWithDistanceAndDropsPixels) {
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  const auto truth = first_frame(open(s, {}));
  s.noise.kind = drivers::NoiseModel::Kind::kinect2;
  const auto noisy = first_frame(open(s, {}));
  std::array<double, 8> squares{};
  std::array<int, 8> count{};
  int dropped = 0;
  for (std::size_t i = 0; i < noisy.depth.size(); ++i) {
    if (noisy.depth[i] == 0) {
      ++dropped;
      continue;
    }
    const auto bin = std::min<std::size_t>(7, truth.depth[i] / 1000u);
    squares[bin] += std::pow(noisy.depth[i] - truth.depth[i], 2);
    ++count[bin];
  }
  ASSERT_GT(count[2], 1000);
  ASSERT_GT(count[5], 1000);
  EXPECT_LT(std::sqrt(squares[2] / count[2]), std::sqrt(squares[5] / count[5]));
  EXPECT_GT(dropped, 200);
  EXPECT_LT(dropped, 20000);
}

TEST(SyntheticCamera, FlyingPixelsLieBetweenPersonAndWall) {
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  const auto clean = first_frame(open(s, {standing()}));
  s.noise.kind = drivers::NoiseModel::Kind::kinect2;
  const auto noisy = first_frame(open(s, {standing()}));
  int between = 0;
  for (int v = 1; v < 423; ++v)
    for (int u = 1; u < 511; ++u) {
      const auto i = static_cast<std::size_t>(v * 512 + u);
      const auto [low, high] = std::minmax({clean.depth[i - 1], clean.depth[i], clean.depth[i + 1], clean.depth[i - 512], clean.depth[i + 512]});
      if (noisy.depth[i] > low + 100 && noisy.depth[i] + 100 < high) ++between;
    }
  EXPECT_GT(between, 100);
}

TEST(SyntheticCamera, AGrazingFloorBesideThePersonIsNoEdge) {
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  const auto clean = first_frame(open(s, {standing()}));
  s.noise.kind = drivers::NoiseModel::Kind::kinect2;
  const auto source = open(s, {standing()});
  const auto noisy = first_frame(source);
  // Where floor and wall meet, in the rows and columns around the person.
  int looked = 0, lost = 0;
  for (int v = 1; v < 423; ++v)
    for (int u = 200; u < 310; ++u) {
      const auto i = static_cast<std::size_t>(v * 512 + u);
      const int step = std::abs(clean.depth[i - 512] - clean.depth[i]),
                sideways = std::abs(clean.depth[i + 1] - clean.depth[i]) + std::abs(clean.depth[i - 1] - clean.depth[i]);
      if (step < 25 || step > 100 || sideways > 30 || clean.depth[i] < 4500) continue;
      ++looked;
      lost += noisy.depth[i] == 0;
    }
  ASSERT_GT(looked, 200);
  EXPECT_LT(lost, looked / 10);
}

TEST(SyntheticScene, CamerasHavePhasesOfTheirOwn) {
  const auto source = open({}, {});
  std::vector<double> phase;
  for (const auto& camera : source.cameras) {
    hal::DepthFrame frame;
    camera->start();
    ASSERT_EQ(camera->read(frame, 1s), hal::ReadStatus::frame);
    camera->stop();
    phase.push_back(hal::seconds(frame.captured.time_since_epoch()) - 1);
    EXPECT_GE(phase.back(), 0);
    EXPECT_LT(phase.back(), 1.0 / 30 + 0.002);
  }
  std::sort(phase.begin(), phase.end());
  EXPECT_GT(phase.back() - phase.front(), 0.003);
}

TEST(SyntheticScene, PeopleEnterAndLeaveAndObstaclesHideThem) {
  auto person = standing();
  person.enters = 0.2;
  person.leaves = 0.4;
  drivers::SceneSettings s;
  s.noise.kind = drivers::NoiseModel::Kind::none;
  s.seconds = 0.6;
  const auto pixels_of = [](const drivers::Source& source, double from, double to) {
    std::size_t most = 0;
    hal::DepthFrame frame;
    source.cameras[0]->start();
    while (source.cameras[0]->read(frame, 1s) == hal::ReadStatus::frame) {
      const double t = hal::seconds(frame.captured.time_since_epoch()) - 1;
      if (t < from || t >= to) continue;
      std::size_t different = 0;
      for (std::size_t i = 0; i < frame.depth.size(); ++i) different += frame.depth[i] != source.background[0].depth[i];
      most = std::max(most, different);
    }
    return most;
  };
  EXPECT_EQ(pixels_of(open(s, {person}), 0, 0.2), 0u);
  EXPECT_EQ(pixels_of(open(s, {person}), 0.4, 0.6), 0u);
  const auto whole = pixels_of(open(s, {person}), 0.2, 0.4);
  EXPECT_GT(whole, 3000u);
  s.obstacles = drivers::chair(0.9, 0.9);
  const auto hidden = pixels_of(open(s, {person}), 0.2, 0.4);
  EXPECT_LT(hidden, whole);
  EXPECT_GT(hidden, whole / 2);
}

TEST(SyntheticScene, SaysWhichSettingIsWrong) {
  drivers::SceneSettings s;
  s.jitter = 1;
  EXPECT_THROW(open(s, {}), std::invalid_argument);
  s = {};
  s.cameras = drivers::camera_ring();
  s.cameras[1].intrinsics.fx = NAN;
  EXPECT_THROW(open(s, {}), std::invalid_argument);
  EXPECT_THROW(drivers::NoiseModel::parse("gaussian:"), std::invalid_argument);
  EXPECT_THROW(drivers::NoiseModel::parse("gaussian:-1"), std::invalid_argument);
  EXPECT_THROW(drivers::NoiseModel::parse("loud"), std::invalid_argument);
}

TEST(ManualClock, SleepingMovesTimeForward) {
  drivers::ManualClock clock;
  const auto start = clock.now();
  clock.sleep_until(start + 5s);
  EXPECT_EQ(clock.now(), start + 5s);
  clock.sleep_until(start);
  EXPECT_EQ(clock.now(), start + 5s) << "never backwards";
  const auto utc = clock.utc_now();
  clock.step_utc(-1h);
  EXPECT_EQ(clock.utc_now(), utc - 1h);
  EXPECT_EQ(clock.now(), start + 5s);
}

}  // namespace
}  // namespace booth::tests
