// A z-buffered triangle painter shared by the overlay and the scene, and what each of them draws around it.
#include "daemon/io/fit_picture.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace booth::daemon {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// A vertex on the drawing board: pixels and distance from the eye; depth infinite when it cannot be drawn.
struct Projected {
  float x = 0, y = 0, depth = kInfinity;
};

/// Nearest surface at each pixel and its colour.
class Canvas {
 public:
  Canvas(int width, int height) : width_(width), height_(height), depth_(cells(), kInfinity), colour_(cells()) {}

  void triangle(const Projected& a, const Projected& b, const Projected& c, Colour ca, Colour cb, Colour cc) {
    if (!(a.depth < kInfinity && b.depth < kInfinity && c.depth < kInfinity)) return;
    const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (!(std::abs(area) > 1e-12f)) return;
    const int left = std::max(0, static_cast<int>(std::ceil(std::min({a.x, b.x, c.x})))),
              right = std::min(width_ - 1, static_cast<int>(std::floor(std::max({a.x, b.x, c.x}))));
    const int top = std::max(0, static_cast<int>(std::ceil(std::min({a.y, b.y, c.y})))),
              bottom = std::min(height_ - 1, static_cast<int>(std::floor(std::max({a.y, b.y, c.y}))));
    for (int y = top; y <= bottom; ++y)
      for (int x = left; x <= right; ++x) {
        const float px = static_cast<float>(x), py = static_cast<float>(y);
        const float wa = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area;
        const float wb = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
        const float wc = 1 - wa - wb;
        if (wa < 0 || wb < 0 || wc < 0) continue;
        const auto mix = [&](std::uint8_t u, std::uint8_t v, std::uint8_t w) {
          return static_cast<std::uint8_t>(std::clamp(wa * static_cast<float>(u) + wb * static_cast<float>(v) + wc * static_cast<float>(w), 0.0f, 255.0f));
        };
        put(x, y, wa * a.depth + wb * b.depth + wc * c.depth, {mix(ca.red, cb.red, cc.red), mix(ca.green, cb.green, cc.green), mix(ca.blue, cb.blue, cc.blue)});
      }
  }

  void put(int x, int y, float depth, Colour c) {
    if (x < 0 || x >= width_ || y < 0 || y >= height_) return;
    const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    if (!(depth < depth_[i])) return;
    depth_[i] = depth;
    colour_[i] = c;
  }

  void over(Picture& picture, float opacity) const {
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
        if (depth_[i] < kInfinity) picture.blend(x, y, colour_[i], opacity);
      }
  }

 private:
  std::size_t cells() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  int width_, height_;
  std::vector<float> depth_;
  std::vector<Colour> colour_;
};

Colour shaded(Colour c, float light) {
  const auto part = [light](std::uint8_t v) { return static_cast<std::uint8_t>(std::clamp(static_cast<float>(v) * light, 0.0f, 255.0f)); };
  return {part(c.red), part(c.green), part(c.blue)};
}

/// As the camera sees it, distortion included; not drawable when behind the camera or so far outside that the distortion model turns round.
Projected project(const fit::Camera& camera, const Eigen::Vector3f& world) {
  const Eigen::Vector3f p = camera.rotation * world + camera.translation;
  if (!(p.z() > 0.05f)) return {};
  const float x = p.x() / p.z(), y = p.y() / p.z();
  const float limit_x = 1.5f * static_cast<float>(camera.width) / camera.fx, limit_y = 1.5f * static_cast<float>(camera.height) / camera.fy;
  if (std::abs(x) > limit_x || std::abs(y) > limit_y) return {};
  const auto& d = camera.distortion;
  const float r2 = x * x + y * y, radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  const float xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x);
  const float yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
  return {camera.fx * xd + camera.cx, camera.fy * yd + camera.cy, p.z()};
}

Colour side_colour(int bone) {
  const char side = fit::bones()[static_cast<std::size_t>(bone)].end_joint.front();
  const bool paired = fit::mirror_bone(bone) != bone;
  if (!paired) return {255, 225, 60};
  return side == 'l' ? Colour{60, 220, 255} : Colour{255, 140, 40};
}

void draw_skeleton(Picture& picture, const fit::Camera& camera, const fit::Points3& joints, float scale) {
  std::array<Projected, fit::kJoints> at;
  for (int j = 0; j < fit::kJoints; ++j) {
    at[static_cast<std::size_t>(j)] = project(camera, joints.col(j).cast<float>());
    // Pixel (0, 0) of the image is the centre of a block of scale x scale pixels of the picture.
    Projected& p = at[static_cast<std::size_t>(j)];
    p.x = (p.x + 0.5f) * scale - 0.5f, p.y = (p.y + 0.5f) * scale - 0.5f;
  }
  const auto drawable = [](const Projected& p) { return p.depth < kInfinity; };
  for (int b = 1; b < fit::kBones; ++b) {
    const Projected &from = at[static_cast<std::size_t>(fit::start_joint(b))], &to = at[static_cast<std::size_t>(b)];
    if (drawable(from) && drawable(to)) picture.line(from.x, from.y, to.x, to.y, 1.5f * scale, side_colour(b));
  }
  for (int j = 0; j < fit::kJoints; ++j) {
    const Projected& p = at[static_cast<std::size_t>(j)];
    if (!drawable(p)) continue;
    picture.disc(p.x, p.y, 1.7f * scale, {20, 20, 20});
    picture.disc(p.x, p.y, 1.2f * scale, side_colour(j));
  }
}

}  // namespace

Picture draw_depth(std::span<const std::uint16_t> depth, int width, int height) {
  Picture picture(width, height, {12, 14, 40});
  if (depth.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    throw std::invalid_argument("draw_depth: the image is not width * height");
  std::vector<std::uint16_t> values;
  for (const std::uint16_t d : depth)
    if (d != 0) values.push_back(d);
  if (values.empty()) return picture;
  const auto at = [&](double fraction) {
    const auto it = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), it, values.end());
    return static_cast<float>(*it);
  };
  const float near = at(0.02), far = std::max(at(0.98), near + 1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const std::uint16_t d = depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
      if (d == 0) continue;
      const float t = std::clamp((static_cast<float>(d) - near) / (far - near), 0.0f, 1.0f);
      const auto grey = static_cast<std::uint8_t>(std::lround(230 - 190 * t));
      picture.set(x, y, {grey, grey, grey});
    }
  return picture;
}

Picture draw_overlay(std::span<const std::uint16_t> depth, const fit::Camera& camera, const fit::Vertices& vertices, const fit::Faces& faces,
                     const fit::Points3* joints, std::string_view caption, const OverlayStyle& style) {
  const int scale = std::clamp(style.scale, 1, 8);
  const Picture small = draw_depth(depth, camera.width, camera.height);
  Picture picture(camera.width * scale, camera.height * scale);
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x) picture.set(x, y, small.at(x / scale, y / scale));

  if (style.mesh_opacity > 0 && vertices.cols() > 0 && faces.cols() > 0) {
    fit::Vertices normals;
    fit::vertex_normals(vertices, faces, normals);
    const float s = static_cast<float>(scale);
    std::vector<Projected> at(static_cast<std::size_t>(vertices.cols()));
    std::vector<Colour> colour(at.size());
    const Eigen::Vector3f eye = camera.centre();
    for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
      Projected p = project(camera, vertices.col(v));
      p.x = (p.x + 0.5f) * s - 0.5f, p.y = (p.y + 0.5f) * s - 0.5f;
      at[static_cast<std::size_t>(v)] = p;
      const float facing = std::max(0.0f, normals.col(v).dot((eye - vertices.col(v)).normalized()));
      colour[static_cast<std::size_t>(v)] = shaded({90, 235, 130}, 0.25f + 0.75f * facing);
    }
    Canvas canvas(picture.width(), picture.height());
    for (Eigen::Index f = 0; f < faces.cols(); ++f) {
      const auto i = [&](int k) { return static_cast<std::size_t>(faces(k, f)); };
      canvas.triangle(at[i(0)], at[i(1)], at[i(2)], colour[i(0)], colour[i(1)], colour[i(2)]);
    }
    canvas.over(picture, std::min(style.mesh_opacity, 1.0f));
  }
  if (style.skeleton && joints != nullptr) draw_skeleton(picture, camera, *joints, static_cast<float>(scale));

  Picture upright = picture.rotated(style.rotation);
  upright.caption(caption, 2);
  return upright;
}

Picture draw_scene(std::span<const SceneItem> items, std::string_view caption, const SceneStyle& style) {
  constexpr int kFiner = 2;  // drawn twice as large, then halved: smooth edges
  Picture picture(style.width * kFiner, style.height * kFiner, style.background);
  Canvas canvas(picture.width(), picture.height());
  // The eye's axes: right, up, towards the eye.
  const Eigen::Vector3f back = style.from.normalized();
  const Eigen::Vector3f reference = std::abs(back.y()) > 0.99f ? Eigen::Vector3f(Eigen::Vector3f::UnitZ()) : Eigen::Vector3f(Eigen::Vector3f::UnitY());
  const Eigen::Vector3f right = reference.cross(back).normalized(), up = back.cross(right);

  Eigen::Vector2f low(kInfinity, kInfinity), high(-kInfinity, -kInfinity);
  for (const SceneItem& item : items)
    for (Eigen::Index i = 0; i < item.points.cols(); ++i) {
      const Eigen::Vector2f p(right.dot(item.points.col(i)), up.dot(item.points.col(i)));
      if (p.allFinite()) low = low.cwiseMin(p), high = high.cwiseMax(p);
    }
  if (!(low.x() <= high.x())) low.setConstant(-1), high.setConstant(1);
  const Eigen::Vector2f middle = (low + high) / 2, extent = (high - low).cwiseMax(0.1f);
  const float w = static_cast<float>(picture.width()), h = static_cast<float>(picture.height());
  const float pixels_per_metre = style.metres_high > 0 ? h / style.metres_high : 0.92f * std::min(w / extent.x(), h / extent.y());
  const auto place = [&](const Eigen::Vector3f& p) -> Projected {
    if (!p.allFinite()) return {};
    return {w / 2 + (right.dot(p) - middle.x()) * pixels_per_metre, h / 2 - (up.dot(p) - middle.y()) * pixels_per_metre, -back.dot(p)};
  };

  const Eigen::Vector3f lamp = (back + 0.6f * up - 0.4f * right).normalized();
  for (const SceneItem& item : items) {
    const auto colour_of = [&](Eigen::Index i) {
      return item.colours != nullptr && !item.colours->empty() ? item.colours->at(static_cast<std::size_t>(i)) : item.colour;
    };
    if (item.faces == nullptr || item.faces->cols() == 0) {
      for (Eigen::Index i = 0; i < item.points.cols(); ++i) {
        const Projected p = place(item.points.col(i));
        if (!(p.depth < kInfinity)) continue;
        for (int k = 0; k < 4; ++k) canvas.put(static_cast<int>(std::lround(p.x)) + k % 2, static_cast<int>(std::lround(p.y)) + k / 2, p.depth, colour_of(i));
      }
      continue;
    }
    fit::Vertices normals;
    fit::vertex_normals(item.points, *item.faces, normals);
    std::vector<Projected> at(static_cast<std::size_t>(item.points.cols()));
    std::vector<Colour> colour(at.size());
    for (Eigen::Index i = 0; i < item.points.cols(); ++i) {
      at[static_cast<std::size_t>(i)] = place(item.points.col(i));
      colour[static_cast<std::size_t>(i)] = shaded(colour_of(i), 0.45f + 0.55f * std::max(0.0f, normals.col(i).dot(lamp)));
    }
    for (Eigen::Index f = 0; f < item.faces->cols(); ++f) {
      const auto i = [&](int k) { return static_cast<std::size_t>((*item.faces)(k, f)); };
      canvas.triangle(at[i(0)], at[i(1)], at[i(2)], colour[i(0)], colour[i(1)], colour[i(2)]);
    }
  }
  canvas.over(picture, 1);
  Picture out = picture.halved();
  out.caption(caption, 2);
  return out;
}

Colour heat(float value, float most) {
  struct Stop {
    float at, red, green, blue;
  };
  static constexpr std::array<Stop, 4> stops{{{0.0f, 40, 90, 200}, {0.35f, 60, 190, 110}, {0.65f, 240, 210, 60}, {1.0f, 215, 45, 35}}};
  const float t = most > 0 && value > 0 ? std::min(value / most, 1.0f) : 0.0f;
  std::size_t i = 1;
  while (i + 1 < stops.size() && t > stops[i].at) ++i;
  const Stop &a = stops[i - 1], &b = stops[i];
  const float u = (t - a.at) / (b.at - a.at);
  const auto mix = [u](float from, float to) { return static_cast<std::uint8_t>(std::lround(from + u * (to - from))); };
  return {mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue)};
}

}  // namespace booth::daemon
