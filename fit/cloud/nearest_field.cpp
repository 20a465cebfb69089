// Seeds cells with their own points, then lets every line of cells along x, y and z choose among its cells' candidates, comparing true distances.
#include "fit/cloud/nearest_field.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/kernel.hpp"

namespace booth::fit {
namespace {

constexpr int kLanes = 16;
constexpr int kMaxSteps = 320;     // cells along an axis; more would be too much for the stack, and for a person
constexpr float kNowhere = 1e30f;  // squared distance of a candidate that there is not
bool usable(float x, float y, float z) { return std::abs(x) < 1000 && std::abs(y) < 1000 && std::abs(z) < 1000; }

/// On a line of cells, a point's squared distance is its squared distance across the line, the same for every cell, plus the squared difference
/// along it. So, given each cell's candidate, the best candidate of the whole line for each cell needs two numbers of each: for kLanes lines side by
/// side, `steps` cells long and `stride` apart, this looks outwards from every cell until the next candidates are too far along the line to win.
/// `coordinate` is the points' along the lines, whose first cell's centre is at `first`.
BOOTH_KERNEL void spread(std::int32_t* index, float* distance2, std::ptrdiff_t stride, int steps, const float* coordinate, float first, float cell) {
  alignas(64) float along[kMaxSteps + 1][kLanes];
  alignas(64) float across2[kMaxSteps + 1][kLanes];
  alignas(64) std::int32_t candidate[kMaxSteps][kLanes];
  const int nowhere = steps;  // stands for every row that has no candidates
  int low = steps, high = -1;
  for (int k = 0; k < kLanes; ++k) along[nowhere][k] = 0, across2[nowhere][k] = kNowhere;
  for (int s = 0; s < steps; ++s) {
    const std::int32_t* own = index + s * stride;
    const float* d = distance2 + s * stride;
    __builtin_prefetch(own + kLanes);  // the lines beside these come next
    __builtin_prefetch(d + kLanes);
    std::int32_t most = -1;
    for (int k = 0; k < kLanes; ++k) candidate[s][k] = own[k], most = std::max(most, own[k]);
    if (most < 0) {
      for (int k = 0; k < kLanes; ++k) along[s][k] = 0, across2[s][k] = kNowhere;
      continue;
    }
    low = std::min(low, s), high = s;
    const float centre = first + static_cast<float>(s) * cell;
    for (int k = 0; k < kLanes; ++k) {
      const std::int32_t i = own[k] < 0 ? 0 : own[k];
      const float a = coordinate[i], difference = a - centre;
      along[s][k] = a;
      across2[s][k] = own[k] < 0 ? kNowhere : d[k] - difference * difference;
    }
  }
  if (high < 0) return;

  for (int s = 0; s < steps; ++s) {
    const float centre = first + static_cast<float>(s) * cell;
    float* d = distance2 + s * stride;
    alignas(64) float best[kLanes];
    alignas(64) std::int32_t row[kLanes];
    for (int k = 0; k < kLanes; ++k) best[k] = d[k], row[k] = s;
    const int last = std::max(s - low, high - s), none = std::max({s - high, low - s, 1});
    for (int step = none; step <= last; step += 2) {
      const float least = (static_cast<float>(step) - 0.5f) * cell;  // a candidate `step` cells along is at least this far away
      std::int32_t farthest = 0;  // positive floats compare as their bits do, and those the vectoriser may reduce in any order
      for (int k = 0; k < kLanes; ++k) farthest = std::max(farthest, std::bit_cast<std::int32_t>(best[k]));
      if (farthest <= std::bit_cast<std::int32_t>(least * least)) break;
      const auto present = [&](int at) { return at < low || at > high ? nowhere : at; };
      const int a = present(s + step), b = present(s - step), c = present(s + step + 1), e = present(s - step - 1);
      for (int k = 0; k < kLanes; ++k) {
        const float fa = along[a][k] - centre, fb = along[b][k] - centre, fc = along[c][k] - centre, fe = along[e][k] - centre;
        const float da = across2[a][k] + fa * fa, db = across2[b][k] + fb * fb, dc = across2[c][k] + fc * fc, de = across2[e][k] + fe * fe;
        float m = best[k];
        std::int32_t r = row[k];
        r = da < m ? a : r, m = da < m ? da : m;
        r = db < m ? b : r, m = db < m ? db : m;
        r = dc < m ? c : r, m = dc < m ? dc : m;
        r = de < m ? e : r, m = de < m ? de : m;
        best[k] = m, row[k] = r;
      }
    }
    std::int32_t* out = index + s * stride;
    for (int k = 0; k < kLanes; ++k) out[k] = candidate[row[k]][k], d[k] = best[k];
  }
}

/// Offers one point to the cells [begin, end) of a row.
BOOTH_KERNEL void tell_row(std::int32_t* index, float* distance2, int begin, int end, std::int32_t point, float x, float across2, float origin, float cell) {
  for (int i = begin; i < end; ++i) {
    const float difference = x - (origin + (static_cast<float>(i) + 0.5f) * cell);
    const float d = across2 + difference * difference;
    const bool nearer = d < distance2[i];
    distance2[i] = nearer ? d : distance2[i];
    index[i] = nearer ? point : index[i];
  }
}

}  // namespace

NearestField::NearestField(NearestFieldSettings settings) : settings_(settings) {
  const auto need = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(std::string("nearest-point field: ") + what);
  };
  need(settings.cell >= 0.002f && settings.cell <= 1, "cell must be 0.002 to 1 m");
  need(settings.band > 0 && settings.band <= 2, "band must be above 0 and at most 2 m");
  need(settings.max_points >= 1 && settings.max_points <= 10'000'000, "max_points must be 1 to 10000000");
  need(settings.max_cells >= 4096 && settings.max_cells <= 100'000'000, "max_cells must be 4096 to 100000000");
  index_.resize(static_cast<std::size_t>(settings.max_cells));
  distance2_.resize(static_cast<std::size_t>(settings.max_cells));
  of_plane_.resize(static_cast<std::size_t>(settings.max_points));
  plane_.resize(static_cast<std::size_t>(settings.max_points));
  plane_start_.resize(kMaxSteps + 1);
}

std::size_t NearestField::memory_bytes() const {
  return index_.size() * (sizeof(std::int32_t) + sizeof(float)) + of_plane_.size() * (sizeof(std::int32_t) + sizeof(std::int16_t)) +
         plane_start_.size() * sizeof(std::int32_t);
}

void NearestField::rebuild(const Cloud& cloud, WorkerPool& pool) {
  const int n = std::min(cloud.size, settings_.max_points);
  constexpr float kHuge = std::numeric_limits<float>::max();
  Eigen::Vector3f low(kHuge, kHuge, kHuge), high = -low;
  int good = 0;
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!usable(cloud.x[k], cloud.y[k], cloud.z[k])) continue;
    const Eigen::Vector3f p(cloud.x[k], cloud.y[k], cloud.z[k]);
    low = low.cwiseMin(p), high = high.cwiseMax(p);
    ++good;
  }
  if (good == 0) {
    nx_ = ny_ = nz_ = 0;
    size_.setZero();
    return;
  }
  if (set_box(low, high)) fill(cloud, pool);
}

bool NearestField::set_box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  cell_ = settings_.cell;
  const auto fits = [&] {
    const Eigen::Vector3f extent = high - low + Eigen::Vector3f::Constant(2 * band_and_margin());
    nx_ = (static_cast<int>(extent.x() / cell_) / kLanes + 1) * kLanes;
    ny_ = static_cast<int>(extent.y() / cell_) + 1, nz_ = static_cast<int>(extent.z() / cell_) + 1;
    return nx_ <= kMaxSteps && ny_ <= kMaxSteps && nz_ <= kMaxSteps && nx_ * ny_ <= settings_.max_plane &&
           static_cast<double>(nx_) * ny_ * nz_ <= settings_.max_cells;
  };
  while (!fits()) cell_ *= 1.1f;
  inverse_cell_ = 1 / cell_;
  origin_ = low - Eigen::Vector3f::Constant(band_and_margin());
  size_ = Eigen::Vector3f(static_cast<float>(nx_), static_cast<float>(ny_), static_cast<float>(nz_));
  return true;
}

void NearestField::fill(const Cloud& cloud, WorkerPool& pool) {
  const int n = std::min(cloud.size, settings_.max_points);
  std::fill_n(plane_start_.begin(), nz_ + 1, 0);
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    plane_[k] = -1;
    if (!usable(cloud.x[k], cloud.y[k], cloud.z[k])) continue;
    plane_[k] = static_cast<std::int16_t>(std::min(static_cast<int>((cloud.z[k] - origin_.z()) * inverse_cell_), nz_ - 1));
    ++plane_start_[static_cast<std::size_t>(plane_[k])];
  }
  std::int32_t sum = 0;
  for (int z = 0; z <= nz_; ++z) plane_start_[static_cast<std::size_t>(z)] = sum += plane_start_[static_cast<std::size_t>(z)];
  for (int i = n - 1; i >= 0; --i)
    if (const auto z = plane_[static_cast<std::size_t>(i)]; z >= 0) of_plane_[static_cast<std::size_t>(--plane_start_[static_cast<std::size_t>(z)])] = i;

  pool.run(nz_, [&](int z) { seed_and_spread_in_plane(cloud, z); });
  pool.run(ny_, [&](int y) { spread_across_planes(cloud, y); });
}

void NearestField::seed_and_spread_in_plane(const Cloud& cloud, int z) {
  const auto plane = static_cast<std::size_t>(z) * static_cast<std::size_t>(ny_) * static_cast<std::size_t>(nx_);
  const auto cells = static_cast<std::size_t>(ny_) * static_cast<std::size_t>(nx_);
  // A cell larger than the band must still know its own points.
  const float reach = std::max(band_and_margin(), 0.87f * cell_), reach2 = reach * reach;
  std::int32_t* index = index_.data() + plane;
  float* distance2 = distance2_.data() + plane;
  std::fill_n(index, cells, -1);
  std::fill_n(distance2, cells, reach2);
  const std::int32_t first = plane_start_[static_cast<std::size_t>(z)], last = plane_start_[static_cast<std::size_t>(z) + 1];
  if (first == last) return;

  // Along x every point tells the cells of its row: had each cell only one point to pass on, the cloud would be thinned to the cells' size.
  const auto centre = [&](int c, float from) { return from + (static_cast<float>(c) + 0.5f) * cell_; };
  const float cz = centre(z, origin_.z());
  const int reach_cells = static_cast<int>(reach * inverse_cell_) + 1;
  for (std::int32_t e = first; e < last; ++e) {
    const auto i = of_plane_[static_cast<std::size_t>(e)];
    const auto k = static_cast<std::size_t>(i);
    const int x = std::min(static_cast<int>((cloud.x[k] - origin_.x()) * inverse_cell_), nx_ - 1);
    const int y = std::min(static_cast<int>((cloud.y[k] - origin_.y()) * inverse_cell_), ny_ - 1);
    const float dy = cloud.y[k] - centre(y, origin_.y()), dz = cloud.z[k] - cz;
    tell_row(index + y * nx_, distance2 + y * nx_, std::max(x - reach_cells, 0), std::min(x + reach_cells + 1, nx_), i, cloud.x[k], dy * dy + dz * dz,
             origin_.x(), cell_);
  }
  for (int x = 0; x < nx_; x += kLanes) spread(index + x, distance2 + x, nx_, ny_, cloud.y.data(), centre(0, origin_.y()), cell_);
}

void NearestField::spread_across_planes(const Cloud& cloud, int y) {
  const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(ny_) * nx_;
  for (int x = 0; x < nx_; x += kLanes) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * nx_ + x;
    spread(index_.data() + at, distance2_.data() + at, plane, nz_, cloud.z.data(), origin_.z() + 0.5f * cell_, cell_);
  }
}

int NearestField::nearest_refined(const Cloud& cloud, const Eigen::Vector3f& p) const {
  const Eigen::Vector3f local = (p - origin_) * inverse_cell_ - Eigen::Vector3f::Constant(0.5f);
  if (!(local.x() >= -1 && local.y() >= -1 && local.z() >= -1 && local.x() < size_.x() && local.y() < size_.y() && local.z() < size_.z())) return -1;
  const int x0 = static_cast<int>(std::floor(local.x())), y0 = static_cast<int>(std::floor(local.y())), z0 = static_cast<int>(std::floor(local.z()));
  int best = -1;
  float best2 = std::numeric_limits<float>::infinity();
  for (int z = std::max(z0, 0); z <= std::min(z0 + 1, nz_ - 1); ++z)
    for (int y = std::max(y0, 0); y <= std::min(y0 + 1, ny_ - 1); ++y)
      for (int x = std::max(x0, 0); x <= std::min(x0 + 1, nx_ - 1); ++x) {
        const std::int32_t i = index_[static_cast<std::size_t>((z * ny_ + y) * nx_ + x)];
        if (i < 0 || i == best) continue;
        const auto k = static_cast<std::size_t>(i);
        const float d = (Eigen::Vector3f(cloud.x[k], cloud.y[k], cloud.z[k]) - p).squaredNorm();
        if (d < best2) best2 = d, best = i;
      }
  return best;
}

}  // namespace booth::fit
