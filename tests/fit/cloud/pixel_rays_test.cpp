// Rays of pixels and pixels of points: what the lens does, where its model ends, and where a pixel sees the stage.
#include "fit/cloud/pixel_rays.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "analytic_scene.hpp"
#include "fit/cloud/projection.hpp"

namespace booth::fit {
namespace {

using tests::booth_cameras;

TEST(PixelRays, UndoTheDistortionThatProjectAdds) {
  Camera camera = booth_cameras(1)[0];
  camera.distortion = {0.09f, -0.27f, 0.002f, -0.003f, 0.095f};
  const PixelRays rays(camera, {});
  float worst = 0;
  for (int v = 0; v < camera.height; v += 7)
    for (int u = 0; u < camera.width; u += 7) {
      const Pixel p = project(camera, rays.point(static_cast<std::size_t>(v * camera.width + u), 2.5f));
      EXPECT_NEAR(p.z, 2.5f, 1e-4f);
      worst = std::max({worst, std::abs(p.u - static_cast<float>(u)), std::abs(p.v - static_cast<float>(v))});
    }
  EXPECT_LT(worst, 0.01f);
}

TEST(Projection, NothingIsSeenWhereTheLensModelFoldsOver) {
  Camera camera = booth_cameras(1)[0];
  camera.distortion = {-0.28f, 0, 0, 0, 0};  // the radius falls from 47.5 degrees on
  const auto at = [&](float degrees) {
    const float a = degrees * 3.14159265f / 180;
    return project(camera, camera.rotation.transpose() * (Eigen::Vector3f(std::sin(a), 0, std::cos(a)) - camera.translation));
  };
  EXPECT_GT(at(45).z, 0);
  EXPECT_GT(at(45).u, at(40).u);
  EXPECT_LE(at(50).z, 0);
  EXPECT_LE(at(70).z, 0);
}

TEST(PixelRays, TheGateIsTheStage) {
  const CloudSettings settings{.stage_x = 0.3f, .stage_z = -0.2f, .stage_radius = 1.5f, .stage_height = 2.0f};
  const PixelRays rays(booth_cameras(1)[0], settings);
  std::mt19937 random(5);
  std::uniform_int_distribution<std::size_t> pixel(0, rays.x.size() - 1);
  std::uniform_int_distribution<int> count(300, 8000);
  int inside_count = 0;
  for (int k = 0; k < 200000; ++k) {
    const std::size_t i = pixel(random);
    const int c = count(random);
    const Eigen::Vector3f p = rays.point(i, static_cast<float>(c) * 0.001f);
    const float r = std::hypot(p.x() - 0.3f, p.z() + 0.2f);
    if (std::abs(r - 1.5f) < 0.003f || std::abs(p.y() - 2.0f) < 0.003f || std::abs(p.y() + 0.1f) < 0.003f) continue;  // on the edge
    const bool inside = r < 1.5f && p.y() < 2.0f && p.y() > -0.1f;
    ASSERT_EQ(c >= rays.near[i] && c <= rays.far[i], inside) << p.transpose();
    inside_count += inside;
  }
  EXPECT_GT(inside_count, 1000);
}

TEST(PixelRays, RefusesImpossibleCameras) {
  const Camera good = booth_cameras(1)[0];
  const auto refuse = [&](auto change) {
    Camera bad = good;
    change(bad);
    EXPECT_THROW(CloudBuilder({}, {good, bad}), std::invalid_argument);
  };
  refuse([](Camera& c) { c.width = 0; });
  refuse([](Camera& c) { c.height = 100000; });
  refuse([](Camera& c) { c.fx = std::nanf(""); });
  refuse([](Camera& c) { c.cy = INFINITY; });
  refuse([](Camera& c) { c.depth_scale = 0; });
  refuse([](Camera& c) { c.depth_offset = std::nanf(""); });
  refuse([](Camera& c) { c.distortion[1] = std::nanf(""); });
  refuse([](Camera& c) { c.rotation(0, 0) += 0.1f; });
  refuse([](Camera& c) { c.rotation.row(2) *= -1; });
  refuse([](Camera& c) { c.translation.y() = std::nanf(""); });
  EXPECT_THROW(CloudBuilder({}, {}), std::invalid_argument);
  EXPECT_THROW(CloudBuilder({.stage_radius = -1}, {good}), std::invalid_argument);
  EXPECT_THROW(CloudBuilder({.voxel = 0}, {good}), std::invalid_argument);
}

/// Cameras that read too near or too far by a few millimetres, and say so: the cloud is that of cameras that read right.
}  // namespace
}  // namespace booth::fit
