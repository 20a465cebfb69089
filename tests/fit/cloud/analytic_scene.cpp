// Exact ray casting; the undistorted rays come from the tables of fit/cloud, which have their own test against fit::project().
#include "analytic_scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <list>
#include <random>
#include <utility>

#include "fit/cloud/pixel_rays.hpp"
#include "fit/cloud/projection.hpp"

namespace booth::tests {
namespace {

using Eigen::Vector3f;

struct Hit {
  float t = std::numeric_limits<float>::infinity();
  Vector3f normal = Vector3f::Zero();
  int owner = -2;
  void offer(float at, const Vector3f& n, int who) {
    if (at > 1e-3f && at < t) t = at, normal = n, owner = who;
  }
};

void sphere(const Vector3f& from, const Vector3f& dir, const Vector3f& centre, float radius, int owner, Hit& hit) {
  const Vector3f o = from - centre;
  const float a = dir.squaredNorm(), b = o.dot(dir), c = o.squaredNorm() - radius * radius, d = b * b - a * c;
  if (d <= 0) return;
  const float t = (-b - std::sqrt(d)) / a;
  hit.offer(t, (o + t * dir) / radius, owner);
}

void capsule(const Vector3f& from, const Vector3f& dir, const Scene::Capsule& c, Hit& hit) {
  sphere(from, dir, c.a, c.radius, c.owner, hit);
  sphere(from, dir, c.b, c.radius, c.owner, hit);
  const Vector3f axis = (c.b - c.a).normalized(), o = from - c.a;
  const Vector3f d = dir - dir.dot(axis) * axis, m = o - o.dot(axis) * axis;
  const float qa = d.squaredNorm(), qb = m.dot(d), qc = m.squaredNorm() - c.radius * c.radius, disc = qb * qb - qa * qc;
  if (qa < 1e-12f || disc <= 0) return;
  const float t = (-qb - std::sqrt(disc)) / qa, along = (o + t * dir).dot(axis);
  if (along > 0 && along < (c.b - c.a).norm()) hit.offer(t, (m + t * d) / c.radius, c.owner);
}

void box(const Vector3f& from, const Vector3f& dir, const Scene::Box& b, Hit& hit) {
  float t0 = -std::numeric_limits<float>::infinity(), t1 = -t0;
  int axis = 0;
  for (int k = 0; k < 3; ++k) {
    float near = (b.low[k] - from[k]) / dir[k], far = (b.high[k] - from[k]) / dir[k];
    if (near > far) std::swap(near, far);
    if (near > t0) t0 = near, axis = k;
    t1 = std::min(t1, far);
  }
  if (t0 < t1) hit.offer(t0, Vector3f::Unit(axis) * (dir[axis] > 0 ? -1.0f : 1.0f), b.owner);
}

/// The part of the image outside which a ball cannot be seen; generous, for the distortion.
struct Window {
  Window(const fit::Camera& camera, const Vector3f& centre, float radius) {
    const fit::Pixel p = fit::project(camera, centre);
    if (p.z < radius + 0.1f) return;  // near or behind: everywhere
    const float reach = camera.fx * radius / (p.z - radius) * 1.2f + 8;
    u0 = p.u - reach, u1 = p.u + reach, v0 = p.v - reach, v1 = p.v + reach;
  }
  bool contains(float u, float v) const { return u >= u0 && u <= u1 && v >= v0 && v <= v1; }
  float u0 = -1e9f, u1 = 1e9f, v0 = -1e9f, v1 = 1e9f;
};

/// Tables are dear, and the tests share a few cameras.
const fit::PixelRays& rays_of(const fit::Camera& camera) {
  static std::list<std::pair<fit::Camera, fit::PixelRays>> known;
  for (const auto& [c, rays] : known)
    if (c.width == camera.width && c.height == camera.height && c.fx == camera.fx && c.fy == camera.fy && c.cx == camera.cx && c.cy == camera.cy &&
        c.distortion == camera.distortion && c.rotation == camera.rotation && c.translation == camera.translation && c.depth_scale == camera.depth_scale)
      return rays;
  return known.emplace_back(camera, fit::PixelRays(camera, fit::CloudSettings{})).second;
}

}  // namespace

std::vector<fit::Camera> booth_cameras(int count) {
  std::vector<fit::Camera> out;
  for (int i = 0; i < count; ++i) {
    fit::Camera c;
    c.width = 512, c.height = 424;
    c.fx = 365.4f, c.fy = 365.6f, c.cx = 257.2f, c.cy = 209.1f;
    c.distortion = {0.0905f, -0.2685f, 0.0f, 0.0f, 0.0950f};
    const Vector3f at(i % 2 ? -2.0f : 2.0f, 1.6f, i / 2 % 2 ? -2.0f : 2.0f);
    const Vector3f forward = (Vector3f(0, 0.95f, 0) - at).normalized(), right = forward.cross(Vector3f::UnitY()).normalized();
    c.rotation.row(0) = right;
    c.rotation.row(1) = forward.cross(right);
    c.rotation.row(2) = forward;
    c.translation = -c.rotation * at;
    out.push_back(c);
  }
  return out;
}

void Scene::add_person(float x, float z, int owner) {
  const auto part = [&](Vector3f a, Vector3f b, float r) { capsules.push_back({a + Vector3f(x, 0, z), b + Vector3f(x, 0, z), r, owner}); };
  for (const float side : {1.0f, -1.0f}) {
    part({0.10f * side, 0.05f, 0}, {0.13f * side, 0.04f, 0.16f}, 0.04f);      // foot
    part({0.10f * side, 0.06f, 0}, {0.10f * side, 0.50f, 0}, 0.05f);          // shin
    part({0.10f * side, 0.50f, 0}, {0.09f * side, 0.90f, 0}, 0.075f);         // thigh
    part({0.19f * side, 1.42f, 0}, {0.38f * side, 1.20f, 0.05f}, 0.045f);     // upper arm
    part({0.38f * side, 1.20f, 0.05f}, {0.55f * side, 1.30f, 0.2f}, 0.035f);  // forearm
  }
  part({0, 0.98f, 0}, {0, 1.35f, 0}, 0.14f);
  part({-0.1f, 1.36f, 0}, {0.1f, 1.36f, 0}, 0.09f);
  part({0, 1.45f, 0}, {0, 1.55f, 0}, 0.055f);
  part({0, 1.62f, 0}, {0, 1.65f, 0.01f}, 0.095f);
}

void Scene::add_squatting_person(float x, float z, int owner) {
  const auto part = [&](Vector3f a, Vector3f b, float r) { capsules.push_back({a + Vector3f(x, 0, z), b + Vector3f(x, 0, z), r, owner}); };
  for (const float side : {1.0f, -1.0f}) {
    part({0.12f * side, 0.05f, 0}, {0.15f * side, 0.04f, 0.16f}, 0.04f);
    part({0.12f * side, 0.06f, 0}, {0.18f * side, 0.46f, 0.18f}, 0.05f);
    part({0.18f * side, 0.46f, 0.18f}, {0.10f * side, 0.24f, -0.18f}, 0.075f);
    part({0.19f * side, 0.74f, 0.0f}, {0.22f * side, 0.52f, 0.15f}, 0.045f);
    part({0.22f * side, 0.52f, 0.15f}, {0.05f * side, 0.55f, 0.32f}, 0.035f);
  }
  part({0, 0.30f, -0.16f}, {0, 0.68f, -0.02f}, 0.14f);
  part({0, 0.80f, 0.0f}, {0, 0.86f, 0.02f}, 0.055f);
  part({0, 0.90f, 0.04f}, {0, 0.93f, 0.05f}, 0.095f);
}

void Scene::add_chair(float x, float z, int owner) {
  const auto part = [&](Vector3f low, Vector3f high) { boxes.push_back({low + Vector3f(x, 0, z), high + Vector3f(x, 0, z), owner}); };
  part({-0.22f, 0.42f, -0.22f}, {0.22f, 0.47f, 0.22f});
  part({-0.22f, 0.47f, -0.22f}, {0.22f, 0.90f, -0.18f});
  for (const float sx : {-0.22f, 0.18f})
    for (const float sz : {-0.22f, 0.18f}) part({sx, 0, sz}, {sx + 0.04f, 0.42f, sz + 0.04f});
}

Rendering render(const Scene& scene, const fit::Camera& camera, int index) {
  const fit::PixelRays& rays = rays_of(camera);
  std::vector<Window> capsule_windows, box_windows;
  for (const auto& c : scene.capsules) capsule_windows.emplace_back(camera, (c.a + c.b) / 2, (c.b - c.a).norm() / 2 + c.radius);
  for (const auto& b : scene.boxes) box_windows.emplace_back(camera, (b.low + b.high) / 2, (b.high - b.low).norm() / 2);
  Rendering out;
  const std::size_t pixels = rays.x.size();
  out.depth.assign(pixels, 0), out.owner.assign(pixels, -2), out.normal.assign(pixels, Vector3f::Zero());
  std::mt19937 random(scene.seed * 977 + static_cast<unsigned>(index));
  std::normal_distribution<float> gauss;
  for (std::size_t i = 0; i < pixels; ++i) {
    const Vector3f dir = rays.to_world * Vector3f(rays.x[i], rays.y[i], 1), from = rays.centre;
    Hit hit;
    const auto u = static_cast<float>(i % static_cast<std::size_t>(camera.width)), v = static_cast<float>(i / static_cast<std::size_t>(camera.width));
    for (std::size_t k = 0; k < scene.capsules.size(); ++k)
      if (capsule_windows[k].contains(u, v)) capsule(from, dir, scene.capsules[k], hit);
    for (std::size_t k = 0; k < scene.boxes.size(); ++k)
      if (box_windows[k].contains(u, v)) box(from, dir, scene.boxes[k], hit);
    if (scene.floor) {  // y - slope x = height
      const float fall = dir.y() - scene.floor_slope_x * dir.x();
      if (fall < 0) hit.offer((scene.floor_height + scene.floor_slope_x * from.x() - from.y()) / fall, Vector3f::UnitY(), -1);
    }
    if (scene.wall > 0) {
      for (const int k : {0, 2})
        if (dir[k] != 0) hit.offer(((dir[k] > 0 ? scene.wall : -scene.wall) - from[k]) / dir[k], Vector3f::Unit(k) * (dir[k] > 0 ? -1.0f : 1.0f), 0);
    }
    const float noise = scene.noise > 0 ? scene.noise * gauss(random) : 0.0f;
    if (hit.t < 20) {
      out.depth[i] = static_cast<std::uint16_t>(std::clamp(std::lround((hit.t + noise) * 1000), 0L, 65535L));
      out.owner[i] = hit.owner;
      out.normal[i] = hit.normal;
    }
  }
  return out;
}

BoothFrame::BoothFrame(const Scene& scene, const std::vector<fit::Camera>& cameras) {
  for (std::size_t i = 0; i < cameras.size(); ++i) images.push_back(render(scene, cameras[i], static_cast<int>(i)));
  for (std::size_t i = 0; i < cameras.size(); ++i) inputs.push_back({static_cast<int>(i), images[i].depth.data(), 0.001 * static_cast<double>(i)});
}

}  // namespace booth::tests
