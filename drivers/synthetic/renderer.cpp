// A float z-buffer, triangles a few pixels large, and a noise model after published measurements of the Kinect v2 (docs/design/synthetic-camera.md).
#include "drivers/synthetic/renderer.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "drivers/synthetic/mix.hpp"
#include "drivers/synthetic/optics.hpp"
#include "fit/kernel.hpp"

namespace booth::drivers {
namespace {

constexpr float kFar = 1000;    // nothing there
constexpr float kNear = 0.15f;  // metres; closer triangles are left out
constexpr float kEdge = 0.06f;  // metres between neighbours that make a depth edge

/// 32 random bits of a pixel; cheap in vector registers.
inline std::uint32_t pixel_bits(std::uint32_t pixel, std::uint32_t key_low, std::uint32_t key_high) {
  std::uint32_t x = pixel * 0x9e3779b9u ^ key_low;
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x += key_high;
  x *= 0x846ca68bu;
  return x ^ (x >> 16);
}

/// Sum of three bytes, centred and scaled to unit variance: near enough to normal, bounded by three sigma, and exact on every machine.
inline float normal_of(std::uint32_t bits) {
  const auto sum = static_cast<std::int32_t>((bits & 255u) + (bits >> 8 & 255u) + (bits >> 16 & 255u));
  return (static_cast<float>(sum) - 382.5f) * (1.0f / 128);
}

BOOTH_KERNEL void add_noise(const float* z, const float* sigma, const std::uint8_t* drop, int count, std::uint32_t key_low, std::uint32_t key_high,
                            float range_min, float range_max, float counts_per_metre, std::uint16_t* out) {
  for (int i = 0; i < count; ++i) {
    const std::uint32_t bits = pixel_bits(static_cast<std::uint32_t>(i), key_low, key_high);
    const float noisy = z[i] + sigma[i] * normal_of(bits);
    const bool seen = (bits >> 24) >= drop[i] && noisy >= range_min && noisy <= range_max;
    out[i] = static_cast<std::uint16_t>(seen ? static_cast<std::int32_t>(noisy * counts_per_metre + 0.5f) : 0);
  }
}

/// Depth jumps beside this pixel. A grazing floor is steep without a jump: there the step goes on in the same direction.
inline bool at_edge(const float* z, int width) {
  const auto jumps = [z](int by) {
    const float before = z[-by] - *z, after = z[by] - *z;
    return std::max(std::abs(before), std::abs(after)) > kEdge && std::abs(before + after) > kEdge;
  };
  return jumps(1) || jumps(width);
}

struct Hit {
  double t;
  Eigen::Vector3d normal;
};

void hit_plane(const Eigen::Vector3d& from, const Eigen::Vector3d& along, int axis, double at, double facing, Hit& best) {
  if (along[axis] * facing >= 0) return;  // seen from behind
  const double t = (at - from[axis]) / along[axis];
  if (t > 1e-6 && t < best.t) best = {t, facing * Eigen::Vector3d::Unit(axis)};
}

void hit_box(const Eigen::Vector3d& from, const Eigen::Vector3d& along, const Box& box, Hit& best) {
  double enter = -1e30, leave = 1e30;
  int axis = 0;
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (along[i] == 0) {
      if (from[i] < box.low[k] || from[i] > box.high[k]) return;
      continue;
    }
    double a = (box.low[k] - from[i]) / along[i], b = (box.high[k] - from[i]) / along[i];
    if (a > b) std::swap(a, b);
    if (a > enter) enter = a, axis = i;
    leave = std::min(leave, b);
  }
  if (enter > 1e-6 && enter <= leave && enter < best.t) best = {enter, (along[axis] > 0 ? -1 : 1) * Eigen::Vector3d::Unit(axis)};
}

}  // namespace

Renderer::Renderer(const hal::CameraDescription& camera, int camera_index, const SceneSettings& settings)
    : camera_(camera),
      camera_index_(camera_index),
      width_(camera.intrinsics.width),
      height_(camera.intrinsics.height),
      noise_(settings.noise),
      seed_(settings.seed),
      range_min_(static_cast<float>(settings.range_min)),
      // Counts are 16 bits wide, whatever range was asked for.
      range_max_(static_cast<float>(std::min(settings.range_max, 65535 * camera.depth_scale))) {
  const auto pixels = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  room_z_.resize(pixels);
  room_sigma_.resize(pixels);
  room_drop_.resize(pixels);
  trace_room(settings);
  z_ = room_z_;
  sigma_ = room_sigma_;
  drop_ = room_drop_;
  left_ = top_ = 0;
  right_ = bottom_ = -1;

  const Eigen::Matrix3d to_world = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.camera_to_world.rotation.data());
  const Eigen::Vector3d centre = Eigen::Map<const Eigen::Vector3d>(camera.camera_to_world.translation.data());
  Eigen::Matrix3d booth_from_cmu_axes;
  for (int i = 0; i < 3; ++i) booth_from_cmu_axes.col(i) = fit::booth_from_cmu(Eigen::Vector3d::Unit(i));
  from_cmu_ = (to_world.transpose() * booth_from_cmu_axes).cast<float>();
  origin_shift_ = (-to_world.transpose() * centre).cast<float>();
}

void Renderer::reserve(int vertices) {
  corner_.resize(std::max(corner_.size(), static_cast<std::size_t>(vertices)));
  if (in_camera_.cols() < vertices) in_camera_.resize(3, vertices);
}

Renderer::Quality Renderer::quality(float z, float cosine, bool dark) const {
  switch (noise_.kind) {
    case NoiseModel::Kind::none:
      return {0, 0};
    case NoiseModel::Kind::gaussian:
      return {static_cast<float>(noise_.sigma), 0};
    case NoiseModel::Kind::kinect2:
      break;
  }
  const float slant = std::max(cosine, 0.2f);
  float sigma = (0.0015f + 0.00022f * z * z) / slant, drop = 0.004f;
  if (cosine < 0.25f) drop += 0.9f * (0.25f - cosine) / 0.25f;
  if (dark) {
    sigma *= 2;
    drop += 0.2f;
  }
  return {sigma, static_cast<std::uint8_t>(std::clamp(drop * 256, 0.0f, 255.0f))};
}

void Renderer::trace_room(const SceneSettings& settings) {
  const Eigen::Matrix3d to_world = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera_.camera_to_world.rotation.data());
  const Eigen::Vector3d centre = Eigen::Map<const Eigen::Vector3d>(camera_.camera_to_world.translation.data());
  double widest = 0;
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const Eigen::Vector2d ray = undistorted_ray(camera_.intrinsics, x, y);
      widest = std::max(widest, ray.squaredNorm());
      const Eigen::Vector3d along = to_world * Eigen::Vector3d(ray.x(), ray.y(), 1);
      Hit hit{1e30, Eigen::Vector3d::Zero()};
      if (settings.floor) hit_plane(centre, along, 2, 0, 1, hit);
      if (const double w = settings.room_half_width; w > 0)
        for (int axis = 0; axis < 2; ++axis) {
          hit_plane(centre, along, axis, w, -1, hit);
          hit_plane(centre, along, axis, -w, 1, hit);
        }
      for (const Box& box : settings.obstacles) hit_box(centre, along, box, hit);
      const auto i = static_cast<std::size_t>(y * width_ + x);
      room_z_[i] = hit.t < kFar ? static_cast<float>(hit.t) : kFar;
      const Quality q = quality(room_z_[i], static_cast<float>(-hit.normal.dot(along) / along.norm()), false);
      room_sigma_[i] = hit.t < kFar ? q.sigma : 0;
      room_drop_[i] = q.drop;
    }
  radius_limit_ = static_cast<float>(widest * 1.2);
  for (int y = 1; y + 1 < height_; ++y)
    for (int x = 1; x + 1 < width_; ++x) {
      const int i = y * width_ + x;
      if (at_edge(room_z_.data() + i, width_)) room_edges_.push_back(i);
    }
}

void Renderer::begin() {
  for (int y = top_; y <= bottom_; ++y) {
    const auto from = static_cast<std::ptrdiff_t>(y) * width_ + left_, to = from + (right_ - left_) + 1;
    std::copy(room_z_.begin() + from, room_z_.begin() + to, z_.begin() + from);
    std::copy(room_sigma_.begin() + from, room_sigma_.begin() + to, sigma_.begin() + from);
    std::copy(room_drop_.begin() + from, room_drop_.begin() + to, drop_.begin() + from);
  }
  left_ = width_, top_ = height_;
  right_ = bottom_ = -1;
}

void Renderer::draw(const fit::Vertices& vertices, const fit::Faces& faces, const std::vector<std::uint8_t>& dark) {
  const auto& k = camera_.intrinsics;
  const auto fx = static_cast<float>(k.fx), fy = static_cast<float>(k.fy), cx = static_cast<float>(k.cx), cy = static_cast<float>(k.cy);
  const int count = static_cast<int>(vertices.cols());
  reserve(count);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3f p = from_cmu_ * vertices.col(i) + origin_shift_;
    in_camera_.col(i) = p;
    Corner& c = corner_[static_cast<std::size_t>(i)];
    c.z = 0;  // not drawable
    if (p.z() < kNear) continue;
    const float x = p.x() / p.z(), y = p.y() / p.z();
    if (x * x + y * y > radius_limit_) continue;
    const Eigen::Vector2f d = distort(k, x, y);
    c = {fx * d.x() + cx, fy * d.y() + cy, p.z()};
  }
  for (int f = 0; f < faces.cols(); ++f) {
    const int ia = faces(0, f), ib = faces(1, f), ic = faces(2, f);
    const Corner &a = corner_[static_cast<std::size_t>(ia)], &b = corner_[static_cast<std::size_t>(ib)], &c = corner_[static_cast<std::size_t>(ic)];
    if (a.z == 0 || b.z == 0 || c.z == 0) continue;
    const Eigen::Vector3f pa = in_camera_.col(ia);
    const Eigen::Vector3f normal = (in_camera_.col(ib) - pa).cross(in_camera_.col(ic) - pa);
    const float towards = -normal.dot(pa);
    if (towards <= 0) continue;  // the back of the body
    const float cosine = towards / (normal.norm() * pa.norm());
    fill(a, b, c, quality(a.z, cosine, dark[static_cast<std::size_t>(f)] != 0));
  }
}

void Renderer::fill(const Corner& a, const Corner& b, const Corner& c, Quality q) {
  const int x0 = std::max(0, static_cast<int>(std::ceil(std::min({a.u, b.u, c.u})))),
            x1 = std::min(width_ - 1, static_cast<int>(std::floor(std::max({a.u, b.u, c.u}))));
  const int y0 = std::max(0, static_cast<int>(std::ceil(std::min({a.v, b.v, c.v})))),
            y1 = std::min(height_ - 1, static_cast<int>(std::floor(std::max({a.v, b.v, c.v}))));
  if (x0 > x1 || y0 > y1) return;
  const float area = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
  if (std::abs(area) < 1e-9f) return;
  // Barycentric coordinates and 1/z are linear over the picture of a triangle this small.
  const float s = 1 / area, ia = 1 / a.z, ib = 1 / b.z, ic = 1 / c.z;
  const float wb_x = (c.v - a.v) * s, wb_y = -(c.u - a.u) * s, wc_x = -(b.v - a.v) * s, wc_y = (b.u - a.u) * s;
  for (int y = y0; y <= y1; ++y) {
    const float dy = static_cast<float>(y) - a.v;
    for (int x = x0; x <= x1; ++x) {
      const float dx = static_cast<float>(x) - a.u;
      const float wb = wb_x * dx + wb_y * dy, wc = wc_x * dx + wc_y * dy;
      if (wb < 0 || wc < 0 || wb + wc > 1) continue;
      const float z = 1 / (ia + wb * (ib - ia) + wc * (ic - ia));
      const auto i = static_cast<std::size_t>(y * width_ + x);
      if (z >= z_[i]) continue;
      z_[i] = z;
      sigma_[i] = q.sigma;
      drop_[i] = q.drop;
    }
  }
  left_ = std::min(left_, x0), right_ = std::max(right_, x1);
  top_ = std::min(top_, y0), bottom_ = std::max(bottom_, y1);
}

void Renderer::finish(std::uint64_t frame, std::uint16_t* out) {
  const std::uint64_t key = mix(mix(mix(seed_ + 0x9e3779b97f4a7c15ull) + static_cast<std::uint64_t>(camera_index_)) + frame);
  add_noise(z_.data(), sigma_.data(), drop_.data(), width_ * height_, static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32), range_min_,
            range_max_, static_cast<float>(1 / camera_.depth_scale), out);
  if (noise_.kind == NoiseModel::Kind::kinect2) add_edge_effects(mix(key), out);
}

void Renderer::add_edge_effects(std::uint64_t key, std::uint16_t* out) {
  const int x0 = std::max(1, left_ - 1), x1 = std::min(width_ - 2, right_ + 1), y0 = std::max(1, top_ - 1), y1 = std::min(height_ - 2, bottom_ + 1);
  for (const std::int32_t i : room_edges_) {
    const int x = i % width_, y = i / width_;
    if (x < x0 || x > x1 || y < y0 || y > y1) edge_pixel(x, y, key, out);
  }
  for (int y = y0; y <= y1; ++y) {
    const float* row = z_.data() + static_cast<std::ptrdiff_t>(y) * width_;
    for (int x = x0; x <= x1; ++x) {
      if (at_edge(row + x, width_)) edge_pixel(x, y, key, out);
    }
  }
}

/// The light of two surfaces mixes at an edge: nothing, something between them, or the neighbour's depth.
void Renderer::edge_pixel(int x, int y, std::uint64_t key, std::uint16_t* out) {
  const int i = y * width_ + x;
  const float z = z_[static_cast<std::size_t>(i)];
  float other = z;
  for (const int j : {i - 1, i + 1, i - width_, i + width_})
    if (const float n = z_[static_cast<std::size_t>(j)]; std::abs(n - z) > std::abs(other - z)) other = n;
  const std::uint32_t bits = pixel_bits(static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32));
  const std::uint32_t fate = bits & 255u;
  if (fate < 64) {
    out[i] = 0;
    return;
  }
  float seen;
  if (fate < 134) {
    seen = z + (other - z) * (static_cast<float>(bits >> 8 & 255u) + 0.5f) / 256;
  } else if (fate < 172) {
    seen = other + sigma_[static_cast<std::size_t>(i)] * normal_of(bits >> 8);
  } else {
    return;
  }
  out[i] = static_cast<std::uint16_t>(
      seen >= range_min_ && seen <= range_max_ ? static_cast<std::int32_t>(seen / static_cast<float>(camera_.depth_scale) + 0.5f) : 0);
}

}  // namespace booth::drivers
