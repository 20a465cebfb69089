// The passes over one group of depth images, each parallel over bands of rows, with the few serial steps between them.
#include "fit/cloud/cloud_builder.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "fit/cloud/floor_plane.hpp"
#include "fit/cloud/organised_normals.hpp"
#include "fit/cloud/pixel_rays.hpp"
#include "fit/cloud/silhouette.hpp"
#include "fit/cloud/voxel_components.hpp"
#include "fit/kernel.hpp"
#include "fit/parallel.hpp"

namespace booth::fit {
namespace {

constexpr int kBandRows = 16;
constexpr int kFloorStep = 8;  // every so many rows and columns vouch for the floor; divides kBandRows
constexpr int kPadLeft = kNormalRadius, kPadRight = kNormalRadius + kNormalLanes;

/// A neighbour lies on the same surface when its depth differs by no more than this: noise, and a slant of about 76 degrees.
constexpr float kGateNoise = 0.01f, kGatePitches = 4;
/// Normals look over twice the pixels, so their gate is twice as wide.
constexpr float kNormalGate = 2;

enum class Fate : std::uint8_t { candidate, isolated, flying, other, person };

CloudSettings checked(const CloudSettings& s) {
  const auto need = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(std::string("cloud settings: ") + what);
  };
  need(std::abs(s.stage_x) < 100 && std::abs(s.stage_z) < 100, "the stage's centre must be within 100 m of the origin");
  need(s.stage_radius >= 0.3f && s.stage_radius <= 10, "stage.radius must be 0.3 to 10 m");
  need(s.stage_height >= 0.5f && s.stage_height <= 10, "stage.height must be 0.5 to 10 m");
  need(s.min_depth > 0 && s.max_depth > s.min_depth && s.max_depth <= 60, "the depth range must be positive, in order, and end before 60 m");
  need(s.floor_margin >= 0 && s.floor_margin <= 0.05f, "floor_margin must be 0 to 0.05 m");
  need(s.background_margin >= 0 && s.background_margin <= 1 && s.background_relative >= 0 && s.background_relative <= 0.5f,
       "background_margin must be 0 to 1 m, background_relative 0 to 0.5");
  need(s.min_neighbours >= 0 && s.min_neighbours <= 8, "min_neighbours must be 0 to 8");
  need(s.voxel >= 0.01f && s.voxel <= 0.2f, "voxel must be 0.01 to 0.2 m");
  need(s.rejoin_gap >= 0 && s.rejoin_gap <= 0.3f && s.rejoin_gap <= 8 * s.voxel, "rejoin_gap must be 0 to 0.3 m and no more than 8 voxels");
  return s;
}

/// Everything the passes remember of one camera's pixels.
struct CameraWork {
  CameraWork(const Camera& camera, const CloudSettings& settings)
      : rays(camera, settings),
        gate_slope(kGatePitches / std::min(camera.fx, camera.fy)),
        stride(camera.width + kPadLeft + kPadRight),
        pixel(rays.x.size()),
        voxel(rays.x.size()),
        fate(rays.x.size()),
        x(rays.x.size()),
        y(rays.x.size()),
        z(rays.x.size()),
        inverse(static_cast<std::size_t>(stride) * static_cast<std::size_t>(camera.height + 2 * kNormalRadius), 0.0f) {}

  float* inverse_at(int u, int v) { return inverse.data() + static_cast<std::ptrdiff_t>(v + kNormalRadius) * stride + kPadLeft + u; }
  float depth_gate(float metres) const { return kGateNoise + gate_slope * metres; }

  PixelRays rays;
  float gate_slope;
  int stride;  // of `inverse`
  // The pixels that see the stage, each band of rows from its own first pixel's place on.
  std::vector<std::int32_t> pixel, voxel;
  std::vector<Fate> fate;
  std::vector<float> x, y, z;  // CMU frame
  std::vector<float> inverse;  // 1 / depth of those of them that are still in the running, padded with zeros; zero elsewhere
  const std::uint16_t* depth = nullptr;
  View* view = nullptr;
};

/// A few rows of one camera: the unit of work.
struct Band {
  int camera, row_begin, row_end;
  int first, count;              // its pixels in CameraWork
  int floor_first, floor_count;  // its samples of the floor
  int raw, floor, isolated, flying, other, person;
  int cloud_first;  // number of its first person pixel among all
};

/// The floor in a camera's own terms.
struct FloorOfCamera {
  float base, slope0, slope_x, slope_y;
};

struct CameraRow {
  const std::uint16_t *raw, *near, *far;
  const float *x, *y;
  std::uint16_t min_count, max_count;
  float scale, offset;
};

struct RowCount {
  int measured, floor;
};

/// One row: depth in metres, labels as if all were background, and which pixels stand on the stage. A pixel's height above the floor is
/// base + depth * (slope0 + slope_x x + slope_y y).
BOOTH_KERNEL RowCount convert_row(const CameraRow& in, const FloorOfCamera& floor, float margin, int n, float* __restrict depth, PixelLabel* __restrict label,
                                  std::uint8_t* __restrict standing) {
  const std::uint16_t* __restrict raw = in.raw, * __restrict near = in.near, * __restrict far = in.far;
  const float* __restrict x = in.x, * __restrict y = in.y;
  const std::uint16_t min_count = in.min_count, max_count = in.max_count;
  const float scale = in.scale, offset = in.offset, base = floor.base - margin, slope0 = floor.slope0, slope_x = floor.slope_x, slope_y = floor.slope_y;
  int measured = 0, on_floor = 0;
  for (int i = 0; i < n; ++i) {
    const bool valid = (raw[i] >= min_count) & (raw[i] <= max_count);
    depth[i] = valid ? static_cast<float>(raw[i]) * scale + offset : 0.0f;
    measured += valid;
  }
  static_assert(static_cast<int>(PixelLabel::unknown) == 0 && static_cast<int>(PixelLabel::background) == 2);
  for (int i = 0; i < n; ++i) label[i] = static_cast<PixelLabel>(((raw[i] >= min_count) & (raw[i] <= max_count)) << 1);
  for (int i = 0; i < n; ++i) standing[i] = static_cast<std::uint8_t>((raw[i] >= near[i]) & (raw[i] <= far[i]));
  for (int i = 0; i < n; ++i) {
    const bool low = base + depth[i] * (slope0 + slope_x * x[i] + slope_y * y[i]) < 0;
    const int drop = standing[i] & static_cast<int>(low);
    standing[i] = static_cast<std::uint8_t>(standing[i] - drop);
    on_floor += drop;
  }
  return {measured, on_floor};
}

}  // namespace

const char* describe(CloudOutcome outcome) {
  switch (outcome) {
    case CloudOutcome::person:
      return "a person";
    case CloudOutcome::no_frame:
      return "no camera gave an image";
    case CloudOutcome::no_measurement:
      return "all points invalid";
    case CloudOutcome::empty_stage:
      return "the stage is empty";
    case CloudOutcome::nobody:
      return "nothing on the stage has the size of a person";
    case CloudOutcome::unprepared:
      return "the observation belongs to other cameras";
  }
  return "unknown";
}

struct CloudBuilder::Impl {
  Impl(const CloudSettings& s, std::vector<Camera> c) : settings(checked(s)), cameras(std::move(c)), components(settings), pool(settings.threads) {
    if (cameras.empty() || cameras.size() > 16) throw std::invalid_argument("cloud: " + std::to_string(cameras.size()) + " cameras; 1 to 16 are possible");
    std::size_t floor_samples = 0;
    work.reserve(cameras.size());
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const Camera& camera = cameras[i];
      try {
        work.emplace_back(camera, settings);
      } catch (const std::invalid_argument& e) {
        throw std::invalid_argument("camera " + std::to_string(i) + ": " + e.what());
      }
      for (int row = 0; row < camera.height; row += kBandRows) {
        Band band{};
        band.camera = static_cast<int>(i);
        band.row_begin = row, band.row_end = std::min(row + kBandRows, camera.height);
        band.first = row * camera.width;
        band.floor_first = static_cast<int>(floor_samples);
        floor_samples += static_cast<std::size_t>((band.row_end - row + kFloorStep - 1) / kFloorStep) *
                         static_cast<std::size_t>((camera.width + kFloorStep - 1) / kFloorStep);
        bands.push_back(band);
      }
    }
    floor_points.resize(floor_samples);
  }

  template <typename Pass>
  void each_band(Pass pass) {
    pool.run(static_cast<int>(bands.size()), [&](int i) {
      Band& band = bands[static_cast<std::size_t>(i)];
      CameraWork& w = work[static_cast<std::size_t>(band.camera)];
      if (w.depth) pass(band, w);
    });
  }

  void sample_floor(Band& band, CameraWork& w);
  void measure_floor(Observation& out, CloudReport& report);
  void project(Band& band, CameraWork& w);
  void drop_unsupported(Band& band, CameraWork& w);
  void decide(Band& band, CameraWork& w);
  void emit(const Band& band, CameraWork& w, Cloud& cloud, int persons) const;
  float floor_under(const Cloud& cloud) const;
  bool assign(std::span<const DepthInput> inputs, Observation& out, CloudReport& report);
  void sum(CloudReport& report) const;

  CloudSettings settings;
  std::vector<Camera> cameras;
  std::vector<CameraWork> work;
  std::vector<Band> bands;
  std::vector<Eigen::Vector3f> floor_points;  // relative to the stage's centre
  FloorPlane floor;
  float floor_margin = 0;
  VoxelComponents components;
  WorkerPool pool;
};

/// Binds images and views to the cameras. False when nothing can be done.
bool CloudBuilder::Impl::assign(std::span<const DepthInput> inputs, Observation& out, CloudReport& report) {
  for (CameraWork& w : work) w.depth = nullptr, w.view = nullptr;
  if (out.views.size() != cameras.size()) {
    report.outcome = CloudOutcome::unprepared;
    return false;
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    View& view = out.views[i];
    const std::size_t pixels = work[i].pixel.size();
    const auto nodes = static_cast<std::size_t>(silhouette_places(cameras[i].width)) * static_cast<std::size_t>(silhouette_places(cameras[i].height));
    if (view.depth.size() != pixels || view.label.size() != pixels || view.nearest_dx.size() != nodes || view.nearest_dy.size() != nodes) {
      report.outcome = CloudOutcome::unprepared;
      return false;
    }
    view.camera = cameras[i];
    view.valid = false;
    view.time_offset = 0;
    work[i].view = &view;
  }
  for (const DepthInput& input : inputs) {
    if (input.camera < 0 || input.camera >= static_cast<int>(work.size()) || !input.depth) continue;
    CameraWork& w = work[static_cast<std::size_t>(input.camera)];
    if (w.depth) continue;
    w.depth = input.depth;
    w.view->valid = true;
    w.view->time_offset = static_cast<float>(input.time_offset);
    ++report.frames;
  }
  return report.frames > 0;
}

/// Points near the calibrated floor, from every kFloorStep-th row and column. Background images do not matter here: the floor is in them.
void CloudBuilder::Impl::sample_floor(Band& band, CameraWork& w) {
  const int width = w.rays.width;
  band.floor_count = 0;
  for (int v = band.row_begin; v < band.row_end; v += kFloorStep) {
    for (int u = 0; u < width; u += kFloorStep) {
      const auto i = static_cast<std::size_t>(v * width + u);
      if (w.depth[i] < w.rays.near[i] || w.depth[i] > w.rays.stage_far[i]) continue;
      Eigen::Vector3f p = w.rays.point(i, static_cast<float>(w.depth[i]) * w.rays.scale + w.rays.offset);
      p.x() -= settings.stage_x, p.z() -= settings.stage_z;
      if (std::abs(p.y()) < kFloorSearch) floor_points[static_cast<std::size_t>(band.floor_first + band.floor_count++)] = p;
    }
  }
}

void CloudBuilder::Impl::measure_floor(Observation& out, CloudReport& report) {
  std::size_t n = 0;
  for (const Band& band : bands) {
    if (!work[static_cast<std::size_t>(band.camera)].depth) continue;
    for (int k = 0; k < band.floor_count; ++k) floor_points[n++] = floor_points[static_cast<std::size_t>(band.floor_first + k)];
  }
  floor = fit_floor(std::span(floor_points.data(), n));
  floor_margin = std::max(settings.floor_margin, std::min(2.5f * floor.sigma, 0.03f));
  out.floor_known = true;
  report.floor_measured = floor.measured;
  report.floor_height = floor.height;
  report.floor_tilt_x = floor.slope_x, report.floor_tilt_z = floor.slope_z;
  report.floor_sigma = floor.sigma;
}

/// Counts to metres, and points for the pixels that stand on the stage above the floor.
void CloudBuilder::Impl::project(Band& band, CameraWork& w) {
  const PixelRays& rays = w.rays;
  const int width = rays.width;
  for (int k = 0; k < band.count; ++k) {  // what the frame before left behind
    const int i = w.pixel[static_cast<std::size_t>(band.first + k)];
    *w.inverse_at(i % width, i / width) = 0;
  }
  band.raw = band.floor = band.count = 0;
  const Eigen::Vector3f up(-floor.slope_x, 1, -floor.slope_z), slope = rays.to_world.transpose() * up;
  const FloorOfCamera plane{floor.above(rays.centre.x() - settings.stage_x, rays.centre.y(), rays.centre.z() - settings.stage_z), slope.z(), slope.x(),
                            slope.y()};
  std::uint8_t standing[kMaxImageWidth + 8];
  for (int v = band.row_begin; v < band.row_end; ++v) {
    const auto row = static_cast<std::size_t>(v) * static_cast<std::size_t>(width);
    const CameraRow in{w.depth + row,       rays.near.data() + row, rays.far.data() + row, rays.x.data() + row,
                       rays.y.data() + row, rays.min_count,         rays.max_count,        rays.scale,
                       rays.offset};
    float* depth = w.view->depth.data() + row;
    const RowCount count = convert_row(in, plane, floor_margin, width, depth, w.view->label.data() + row, standing);
    band.raw += count.measured;
    band.floor += count.floor;
    std::memset(standing + width, 0, 8);
    for (int u = 0; u < width; u += 8) {
      std::uint64_t eight;
      std::memcpy(&eight, standing + u, 8);
      if (eight == 0) continue;
      for (int k = u; k < std::min(u + 8, width); ++k) {
        if (!standing[k]) continue;
        const auto at = static_cast<std::size_t>(band.first + band.count++);
        const Eigen::Vector3f p = rays.point(row + static_cast<std::size_t>(k), depth[k]);
        w.pixel[at] = static_cast<std::int32_t>(row) + k;
        w.fate[at] = Fate::candidate;
        w.x[at] = p.x(), w.y[at] = p.y(), w.z[at] = p.z();
        *w.inverse_at(k, v) = 1 / depth[k];
      }
    }
  }
}

/// Isolated pixels, and pixels that hang between two surfaces. Reads neighbours of other bands, and so writes nothing that they read.
void CloudBuilder::Impl::drop_unsupported(Band& band, CameraWork& w) {
  const int width = w.rays.width, height = w.rays.height;
  const std::ptrdiff_t s = w.stride;
  const std::ptrdiff_t around[8] = {-s - 1, -s, -s + 1, -1, 1, s - 1, s, s + 1};
  const float* depth = w.view->depth.data();
  band.isolated = band.flying = 0;
  for (auto k = static_cast<std::size_t>(band.first); k < static_cast<std::size_t>(band.first + band.count); ++k) {
    const int i = w.pixel[k], u = i % width, v = i / width;
    const float* here = w.inverse_at(u, v);
    const float z = depth[i], gate = w.depth_gate(z);
    const float inverse_gate = gate * *here * *here;
    int neighbours = 0;
    for (const std::ptrdiff_t step : around) neighbours += std::abs(here[step] - *here) < inverse_gate;
    if (neighbours < settings.min_neighbours) {
      w.fate[k] = Fate::isolated;
      ++band.isolated;
      continue;
    }
    if (u == 0 || v == 0 || u == width - 1 || v == height - 1) continue;
    const int opposite[4] = {1, width, width + 1, width - 1};
    for (const int step : opposite) {
      const float a = depth[i - step], b = depth[i + step];
      if (a == 0 || b == 0 || std::min(a, b) > z - gate || std::max(a, b) < z + gate) continue;
      w.fate[k] = Fate::flying;
      ++band.flying;
      break;
    }
  }
}

/// The verdict of each pixel's component, into the labels.
void CloudBuilder::Impl::decide(Band& band, CameraWork& w) {
  const int width = w.rays.width;
  band.other = band.person = 0;
  for (auto k = static_cast<std::size_t>(band.first); k < static_cast<std::size_t>(band.first + band.count); ++k) {
    if (w.fate[k] == Fate::candidate) {
      switch (components.verdict(w.voxel[k])) {
        case VoxelVerdict::person:
          w.fate[k] = Fate::person;
          break;
        case VoxelVerdict::other:
          w.fate[k] = Fate::other;
          break;
        case VoxelVerdict::speck:
          w.fate[k] = Fate::isolated;
          break;
      }
      band.isolated += w.fate[k] == Fate::isolated;
    }
    const auto i = static_cast<std::size_t>(w.pixel[k]);
    if (w.fate[k] == Fate::person) {
      w.view->label[i] = PixelLabel::person;
      ++band.person;
      continue;
    }
    *w.inverse_at(static_cast<int>(i) % width, static_cast<int>(i) / width) = 0;
    if (w.fate[k] == Fate::other) {
      ++band.other;
    } else {  // a measurement that is not believed is evidence of nothing
      w.view->label[i] = PixelLabel::unknown;
      w.view->depth[i] = 0;
    }
  }
}

/// Normals, and the band's share of the cloud: of n person pixels the evenly spread ones that fit its capacity.
void CloudBuilder::Impl::emit(const Band& band, CameraWork& w, Cloud& cloud, int persons) const {
  const int width = w.rays.width;
  const std::int64_t capacity = std::min(cloud.capacity(), persons);
  InverseDepthFit fit{};
  int fitted_from = -kNormalLanes;  // pixel of lane 0
  std::int64_t number = band.cloud_first;
  for (auto k = static_cast<std::size_t>(band.first); k < static_cast<std::size_t>(band.first + band.count); ++k) {
    if (w.fate[k] != Fate::person) continue;
    const std::int64_t at = number * capacity / persons, next = (number + 1) * capacity / persons;
    ++number;
    if (at == next) continue;
    const int i = w.pixel[k], u = i % width;
    // Lanes that run past the row's end read padding, and the next row's pixels are never taken from them.
    if (i >= fitted_from + kNormalLanes || fitted_from / width != i / width) {
      fit_inverse_depth(w.inverse_at(u, i / width), w.stride, kNormalGate * kGateNoise, kNormalGate * w.gate_slope, fit);
      fitted_from = i;
    }
    const auto lane = static_cast<std::size_t>(i - fitted_from);
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    if (fit.support[lane] > 0) {
      // w = a' x + b' y + c' along the ray (x, y, 1) is the plane (a', b', c') . P = 1; the camera, at the origin, is on its other side.
      const auto p = static_cast<std::size_t>(i), pixels_across = static_cast<std::size_t>(width);
      const std::size_t left = u > 0 ? p - 1 : p, right = u < width - 1 ? p + 1 : p;
      const std::size_t up = p >= pixels_across ? p - pixels_across : p, down = p + pixels_across < w.rays.y.size() ? p + pixels_across : p;
      const std::size_t rows = (down - up) / pixels_across;
      const float a = fit.a[lane] * static_cast<float>(right - left) / (w.rays.x[right] - w.rays.x[left]);
      const float b = fit.b[lane] * static_cast<float>(rows) / (w.rays.y[down] - w.rays.y[up]);
      const Eigen::Vector3f plane(a, b, fit.w0[lane] - a * w.rays.x[p] - b * w.rays.y[p]);
      const float length = plane.norm();
      if (length > 0 && std::isfinite(length)) normal = w.rays.to_world * (plane * (-1 / length));
    }
    const auto c = static_cast<std::size_t>(at);
    cloud.x[c] = w.x[k], cloud.y[c] = w.y[k], cloud.z[c] = w.z[k];
    cloud.nx[c] = normal.x(), cloud.ny[c] = normal.y(), cloud.nz[c] = normal.z();
    cloud.camera[c] = static_cast<std::uint8_t>(band.camera);
  }
}

/// A floor that tilts a degree is a centimetre off half a metre away: the height that counts is the one below the person.
float CloudBuilder::Impl::floor_under(const Cloud& cloud) const {
  double x = 0, z = 0;
  int n = 0;
  for (int i = 0; i < cloud.size; i += 16, ++n)
    x += cloud.x[static_cast<std::size_t>(i)] - settings.stage_x, z += cloud.z[static_cast<std::size_t>(i)] - settings.stage_z;
  if (n == 0) return floor.height;
  return floor.height + floor.slope_x * static_cast<float>(x / n) + floor.slope_z * static_cast<float>(z / n);
}

void CloudBuilder::Impl::sum(CloudReport& report) const {
  for (const Band& band : bands) {
    if (!work[static_cast<std::size_t>(band.camera)].depth) continue;
    report.raw += band.raw;
    report.cropped += band.raw - band.floor - band.count;
    report.floor += band.floor;
    report.isolated += band.isolated;
    report.flying += band.flying;
    report.other += band.other;
    report.person += band.person;
  }
}

CloudBuilder::CloudBuilder(CloudSettings settings, std::vector<Camera> cameras) : impl_(std::make_unique<Impl>(settings, std::move(cameras))) {}
CloudBuilder::~CloudBuilder() = default;

const std::vector<Camera>& CloudBuilder::cameras() const { return impl_->cameras; }

Observation CloudBuilder::make_observation(int cloud_capacity) const {
  if (cloud_capacity < 1) throw std::invalid_argument("cloud: a capacity of " + std::to_string(cloud_capacity) + " points; at least one is needed");
  Observation out(cloud_capacity);
  out.views.resize(impl_->cameras.size());
  for (std::size_t i = 0; i < out.views.size(); ++i) {
    const Camera& camera = impl_->cameras[i];
    View& view = out.views[i];
    view.camera = camera;
    view.depth.resize(impl_->work[i].pixel.size());
    view.label.resize(view.depth.size(), PixelLabel::unknown);
    view.nearest_dx.resize(static_cast<std::size_t>(silhouette_places(camera.width)) * static_cast<std::size_t>(silhouette_places(camera.height)),
                           kSilhouetteFar);
    view.nearest_dy.resize(view.nearest_dx.size(), kSilhouetteFar);
  }
  return out;
}

void CloudBuilder::set_background(int camera, std::span<const std::uint16_t> depth) {
  if (camera < 0 || camera >= static_cast<int>(impl_->work.size()))
    throw std::invalid_argument("a background image for camera " + std::to_string(camera) + " of " + std::to_string(impl_->work.size()));
  impl_->work[static_cast<std::size_t>(camera)].rays.set_background(depth);
}

std::size_t CloudBuilder::memory_bytes() const {
  std::size_t bytes = impl_->components.memory_bytes() + impl_->floor_points.size() * sizeof(Eigen::Vector3f) + impl_->bands.size() * sizeof(Band);
  for (const CameraWork& w : impl_->work)
    bytes += w.pixel.size() * (2 * sizeof(std::int32_t) + sizeof(Fate) + 3 * sizeof(float) + 2 * sizeof(float) + 3 * sizeof(std::uint16_t)) +
             w.inverse.size() * sizeof(float);
  return bytes;
}

bool CloudBuilder::build(std::span<const DepthInput> inputs, Observation& out, CloudReport& report, const Followed& followed) {
  Impl& m = *impl_;
  report = {};
  out.cloud.clear();
  out.crowded = false;
  if (!m.assign(inputs, out, report)) return false;

  m.each_band([&](Band& band, CameraWork& w) { m.sample_floor(band, w); });
  m.measure_floor(out, report);
  m.each_band([&](Band& band, CameraWork& w) { m.project(band, w); });
  m.each_band([&](Band& band, CameraWork& w) { m.drop_unsupported(band, w); });

  m.components.clear();
  int standing = 0;
  for (const Band& band : m.bands) {
    CameraWork& w = m.work[static_cast<std::size_t>(band.camera)];
    if (!w.depth) continue;
    for (auto k = static_cast<std::size_t>(band.first); k < static_cast<std::size_t>(band.first + band.count); ++k) {
      if (w.fate[k] != Fate::candidate) continue;
      w.voxel[k] = m.components.insert({w.x[k], w.y[k], w.z[k]});
      ++standing;
    }
  }
  const bool somebody = m.components.judge(report, followed);
  out.crowded = report.crowded;
  m.each_band([&](Band& band, CameraWork& w) { m.decide(band, w); });
  m.sum(report);

  int persons = 0;
  for (Band& band : m.bands) {
    if (!m.work[static_cast<std::size_t>(band.camera)].depth) continue;
    band.cloud_first = persons;
    persons += band.person;
  }
  if (persons > 0) {
    m.each_band([&](Band& band, CameraWork& w) { m.emit(band, w, out.cloud, persons); });
    out.cloud.size = std::min(persons, out.cloud.capacity());
    report.points = out.cloud.size;
  }
  m.pool.run(static_cast<int>(m.work.size()), [&](int i) {
    View& view = *m.work[static_cast<std::size_t>(i)].view;
    if (!view.valid) {  // nothing of an earlier frame may be taken for this one's
      std::fill(view.label.begin(), view.label.end(), PixelLabel::unknown);
      std::fill(view.depth.begin(), view.depth.end(), 0.0f);
    }
    map_silhouette(view);
  });
  out.floor_height = m.floor_under(out.cloud);

  if (somebody) {
    report.outcome = CloudOutcome::person;
  } else if (report.raw == 0) {
    report.outcome = CloudOutcome::no_measurement;
  } else {
    report.outcome = standing > 0 && report.other > 0 ? CloudOutcome::nobody : CloudOutcome::empty_stage;
  }
  return somebody;
}

}  // namespace booth::fit
