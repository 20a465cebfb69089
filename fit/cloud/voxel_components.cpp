// Union-find over occupied voxels, then over components in the order of their gaps.
#include "fit/cloud/voxel_components.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/cloud/floor_plane.hpp"

namespace booth::fit {
namespace {

constexpr int kStrong = 3;  // points that make a voxel hold its neighbours together; a few stray points must not
constexpr std::size_t kMaxComponents = 4096;
constexpr int kSpeck = 4;  // voxels; less is no thing
// m^3 as Component::volume has them, from 1, 2, and 3 or more cameras. A squatting person fills 0.057, 0.094, 0.113, the smallest woman of
// fifty random ones 0.074 from four; a chair with a back of 1.1 m 0.040, 0.049, 0.066: the more sides are seen, the more of the hollow between them counts.
constexpr std::array<float, 3> kCrouchingVolume{0.045f, 0.060f, 0.070f};
constexpr int kCrumb = 12;              // voxels; as little as this, and this low, is the floor's noise and no limb
constexpr float kCrumbHeight = 0.12f;   // m above the floor
constexpr float kLimbFraction = 0.35f;  // of a person's voxels: a piece larger than this is not a limb that came off
constexpr float kFewestNear = 0.15f;    // m^2; who has less near the bones is not who is followed
constexpr float kStillPerson = 0.6f;    // of a person's size is enough for whom the bones run through,
constexpr float kOwnShare = 0.75f;      // if so much of them is near the bones
constexpr float kForeignShare = 0.25f;  // more than this far from the bones is no limb that the tracker lost (a leg is 0.18) but somebody else;
constexpr float kStillForeign = 0.12f;  // and more than this where somebody else was in the frame before (an arm is 0.09)
constexpr float kPersonArea = 0.25f;    // m^2
constexpr float kOthersTop = 1.0f;      // m above the floor: somebody else's is higher, a chair's is not

float distance2(const Eigen::Vector3f& p, const Followed::Bone& bone) {
  const Eigen::Vector3f along = bone.to - bone.from, away = p - bone.from;
  const float length2 = along.squaredNorm();
  const float t = length2 > 0 ? std::clamp(away.dot(along) / length2, 0.0f, 1.0f) : 0.0f;
  return (away - t * along).squaredNorm();
}

}  // namespace

VoxelComponents::VoxelComponents(const CloudSettings& settings) : settings_(settings) {
  const float v = settings.voxel;
  inverse_voxel_ = 1 / v;
  pad_ = static_cast<int>(std::ceil(settings.rejoin_gap / v)) + 1;  // as far as ball_ reaches
  origin_ = Eigen::Vector3f(settings.stage_x - settings.stage_radius, -kFloorSearch, settings.stage_z - settings.stage_radius) -
            Eigen::Vector3f::Constant(static_cast<float>(pad_) * v);
  const double across = std::ceil(2.0 * settings.stage_radius / v) + 2 * pad_, up = std::ceil((settings.stage_height + kFloorSearch) / v) + 2 * pad_;
  if (across * across * up > 4e6)
    throw std::invalid_argument("cloud: a stage of " + std::to_string(settings.stage_radius) + " m radius has too many voxels of " + std::to_string(v) +
                                " m; make the voxels larger");
  nx_ = nz_ = static_cast<int>(across);
  ny_ = static_cast<int>(up);
  const auto voxels = static_cast<std::size_t>(nx_) * static_cast<std::size_t>(ny_) * static_cast<std::size_t>(nz_);
  index_of_.assign(voxels, -1);
  occupied_.reserve(voxels);
  loose_.reserve(voxels);
  components_.reserve(kMaxComponents);

  // Two surfaces `gap` apart have voxels whose centres are one voxel further apart.
  const int radius = pad_;
  const float reach = settings.rejoin_gap / v + 1;
  for (int z = -radius; z <= radius; ++z)
    for (int y = -radius; y <= radius; ++y)
      for (int x = -radius; x <= radius; ++x)
        if (const int d = x * x + y * y + z * z; d > 0 && static_cast<float>(d) <= reach * reach) ball_.push_back({d, (z * ny_ + y) * nx_ + x});
  std::stable_sort(ball_.begin(), ball_.end(), [](const Offset& a, const Offset& b) { return a.distance2 < b.distance2; });
}

std::size_t VoxelComponents::memory_bytes() const {
  return index_of_.size() * sizeof(std::int32_t) + occupied_.capacity() * sizeof(Occupied) + loose_.capacity() * sizeof(std::int32_t) +
         components_.capacity() * sizeof(Component);
}

void VoxelComponents::clear() {
  for (const Occupied& o : occupied_) index_of_[static_cast<std::size_t>(o.voxel)] = -1;
  occupied_.clear();
  components_.clear();
  loose_.clear();
}

int VoxelComponents::insert(const Eigen::Vector3f& p) {
  const Eigen::Vector3f local = (p - origin_) * inverse_voxel_;
  const auto cell = [this](float v, int n) { return std::clamp(static_cast<int>(v), pad_, n - pad_ - 1); };
  const int voxel = (cell(local.z(), nz_) * ny_ + cell(local.y(), ny_)) * nx_ + cell(local.x(), nx_);
  std::int32_t& index = index_of_[static_cast<std::size_t>(voxel)];
  if (index < 0) {
    index = static_cast<std::int32_t>(occupied_.size());
    occupied_.push_back({voxel, 0, index, -1, VoxelVerdict::speck, false});
  }
  ++occupied_[static_cast<std::size_t>(index)].points;
  return index;
}

int VoxelComponents::find_voxel(int i) {
  while (occupied_[static_cast<std::size_t>(i)].parent != i) {
    auto& o = occupied_[static_cast<std::size_t>(i)];
    o.parent = occupied_[static_cast<std::size_t>(o.parent)].parent;
    i = o.parent;
  }
  return i;
}

int VoxelComponents::find_group(int c) {
  while (components_[static_cast<std::size_t>(c)].parent != c) {
    auto& o = components_[static_cast<std::size_t>(c)];
    o.parent = components_[static_cast<std::size_t>(o.parent)].parent;
    c = o.parent;
  }
  return c;
}

/// Strong voxels that touch, corners included, are one component.
void VoxelComponents::connect() {
  std::array<int, 13> before{};  // half of the 26 neighbours; the other half meets this voxel from its own side
  int n = 0;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        if (const int step = (z * ny_ + y) * nx_ + x; step < 0) before[static_cast<std::size_t>(n++)] = step;
  for (std::size_t i = 0; i < occupied_.size(); ++i) {
    if (occupied_[i].points < kStrong) continue;
    for (const int step : before) {
      const std::int32_t j = index_of_[static_cast<std::size_t>(occupied_[i].voxel + step)];
      if (j < 0 || occupied_[static_cast<std::size_t>(j)].points < kStrong) continue;
      const int a = find_voxel(static_cast<int>(i)), b = find_voxel(j);
      occupied_[static_cast<std::size_t>(std::max(a, b))].parent = std::min(a, b);
    }
  }
}

bool VoxelComponents::is_person_sized(const Component& c, float share) const {
  const float v = settings_.voxel;
  const float height = static_cast<float>(c.high[1] - c.low[1] + 1) * v;
  const float across = std::hypot(static_cast<float>(c.high[0] - c.low[0] + 1), static_cast<float>(c.high[2] - c.low[2] + 1)) * v;
  const float extent = std::max(height, across), area = static_cast<float>(c.voxels) * v * v, volume = static_cast<float>(c.volume) * v * v * v;
  if (extent > 3.0f || area > 8) return false;
  const bool stretched = extent >= 1.35f * share && area >= kPersonArea * share && volume >= 0.03f * share;
  const bool crouching = extent >= 0.7f * share && volume >= crouching_volume_ * share;
  return stretched || crouching;
}

void VoxelComponents::measure() {
  for (std::size_t i = 0; i < occupied_.size(); ++i) {
    Occupied& o = occupied_[i];
    if (o.points < kStrong) continue;
    const int root = find_voxel(static_cast<int>(i));
    if (root == static_cast<int>(i)) {
      if (components_.size() == kMaxComponents) continue;  // rubble: what does not fit is specks
      const auto c = static_cast<std::int32_t>(components_.size());
      components_.push_back({c, 0, 0, {nx_, ny_, nz_}, {-1, -1, -1}, 0, 0, 0, false});
      o.component = c;
    } else {
      o.component = occupied_[static_cast<std::size_t>(root)].component;  // a root has the lowest number of its component
    }
    if (o.component < 0) continue;
    Component& c = components_[static_cast<std::size_t>(o.component)];
    const int at[3] = {o.voxel % nx_, o.voxel / nx_ % ny_, o.voxel / nx_ / ny_};
    for (int k = 0; k < 3; ++k) c.low[k] = std::min(c.low[k], at[k]), c.high[k] = std::max(c.high[k], at[k]);
    ++c.voxels;
    c.sum_x += at[0], c.sum_z += at[2];
  }
  for (const Occupied& o : occupied_) {
    if (o.component < 0) continue;
    Component& c = components_[static_cast<std::size_t>(o.component)];
    ++c.volume;
    const int y = o.voxel / nx_ % ny_;
    for (int down = 1; y - down >= c.low[1]; ++down) {  // up to the next of the same component below
      const std::int32_t j = index_of_[static_cast<std::size_t>(o.voxel - down * nx_)];
      if (j < 0 || occupied_[static_cast<std::size_t>(j)].component != o.component) continue;
      c.volume += down - 1;
      break;
    }
  }
  for (Component& c : components_) c.person_sized = is_person_sized(c);
}

void VoxelComponents::unite_groups(int a, int b) {
  if (a > b) std::swap(a, b);
  Component& to = components_[static_cast<std::size_t>(a)];
  const Component& from = components_[static_cast<std::size_t>(b)];
  components_[static_cast<std::size_t>(b)].parent = a;
  to.voxels += from.voxels;
  to.volume += from.volume;
  to.sum_x += from.sum_x, to.sum_z += from.sum_z;
  for (int k = 0; k < 3; ++k) to.low[k] = std::min(to.low[k], from.low[k]), to.high[k] = std::max(to.high[k], from.high[k]);
  to.person_sized = to.person_sized || from.person_sized || is_person_sized(to);
}

/// Kruskal over the gaps: the nearest pieces first. Two persons never become one, and neither things nor crumbs of the floor join a person.
void VoxelComponents::rejoin(float floor_height) {
  const int crumb_top = pad_ + static_cast<int>((kFloorSearch + floor_height + kCrumbHeight) * inverse_voxel_);
  for (std::size_t i = 0; i < occupied_.size(); ++i) {
    if (occupied_[i].component < 0) continue;
    const Component& c = components_[static_cast<std::size_t>(occupied_[i].component)];
    if (!c.person_sized && !(c.voxels < kCrumb && c.high[1] < crumb_top)) loose_.push_back(static_cast<std::int32_t>(i));
  }
  for (const Offset& offset : ball_) {
    for (const std::int32_t i : loose_) {
      const Occupied& o = occupied_[static_cast<std::size_t>(i)];
      const std::int32_t j = index_of_[static_cast<std::size_t>(o.voxel + offset.step)];
      if (j < 0 || occupied_[static_cast<std::size_t>(j)].component < 0) continue;
      const int a = find_group(o.component), b = find_group(occupied_[static_cast<std::size_t>(j)].component);
      if (a == b) continue;
      const Component &ca = components_[static_cast<std::size_t>(a)], &cb = components_[static_cast<std::size_t>(b)];
      if (ca.person_sized && cb.person_sized) continue;
      if (ca.person_sized != cb.person_sized) {
        const Component &person = ca.person_sized ? ca : cb, &piece = ca.person_sized ? cb : ca;
        if (static_cast<float>(piece.voxels) > kLimbFraction * static_cast<float>(person.voxels)) continue;
      }
      unite_groups(a, b);
    }
  }
}

/// Which voxels are near the bones, and how many of each group.
void VoxelComponents::find_near(const Followed& followed) {
  for (Occupied& o : occupied_) {
    const Eigen::Vector3f cell(static_cast<float>(o.voxel % nx_), static_cast<float>(o.voxel / nx_ % ny_), static_cast<float>(o.voxel / nx_ / ny_));
    const Eigen::Vector3f p = origin_ + settings_.voxel * (cell + Eigen::Vector3f::Constant(0.5f));
    o.near = std::any_of(followed.bones.begin(), followed.bones.end(), [&](const Followed::Bone& b) { return distance2(p, b) < b.radius * b.radius; });
    if (o.near && o.component >= 0) ++components_[static_cast<std::size_t>(find_group(o.component))].near;
  }
}

/// The person's group, or -1; counts persons and other components.
int VoxelComponents::choose(CloudReport& report, const Followed& followed) const {
  const double v = settings_.voxel;
  const bool following = !followed.bones.empty();
  const auto fewest_near = static_cast<std::int32_t>(std::ceil(kFewestNear / (v * v)));
  double from_x = settings_.stage_x, from_z = settings_.stage_z;
  if (following) from_x = followed.bones.front().from.x(), from_z = followed.bones.front().from.z();
  int chosen = -1;
  std::int32_t most_near = 0;
  double nearest = following ? followed.strayed * followed.strayed : std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < components_.size(); ++c) {
    const Component& group = components_[c];
    if (group.parent != static_cast<std::int32_t>(c)) continue;
    if (group.voxels >= kSpeck) ++report.other_components;
    // Somebody who is followed stays a person where they bend down, or leave the stage; not without the tracker's word, or furniture would be somebody.
    const bool still = followed.now && static_cast<float>(group.near) >= kOwnShare * static_cast<float>(group.voxels) && is_person_sized(group, kStillPerson);
    if (!group.person_sized && !still) continue;
    ++report.persons;
    if (group.near >= fewest_near) {
      if (group.near > most_near) most_near = group.near, chosen = static_cast<int>(c);
      continue;
    }
    const double x = (group.sum_x / group.voxels + 0.5) * v + origin_.x() - from_x;
    const double z = (group.sum_z / group.voxels + 0.5) * v + origin_.z() - from_z;
    if (const double distance2 = x * x + z * z; most_near == 0 && distance2 < nearest) chosen = static_cast<int>(c), nearest = distance2;
  }
  if (chosen >= 0) --report.other_components;
  return chosen;
}

/// So much of the person's group is far from the bones, and so high, that others are part of it, and enough is near them to go on with.
bool VoxelComponents::others_touch(int chosen, const CloudReport& report, bool before) {
  const Component& person = components_[static_cast<std::size_t>(chosen)];
  const float area = settings_.voxel * settings_.voxel;
  const auto all = static_cast<float>(person.voxels), near = static_cast<float>(person.near);
  if (all - near <= (before ? kStillForeign : kForeignShare) * all || near * area < kStillPerson * kPersonArea) return false;
  const int top = pad_ + static_cast<int>((kFloorSearch + report.floor_height + kOthersTop) * inverse_voxel_);
  for (const Occupied& o : occupied_)
    if (!o.near && o.component >= 0 && o.voxel / nx_ % ny_ >= top && find_group(o.component) == chosen) return true;
  return false;
}

bool VoxelComponents::judge(CloudReport& report, const Followed& followed) {
  crouching_volume_ = kCrouchingVolume[static_cast<std::size_t>(std::clamp(report.frames, 1, 3) - 1)];
  connect();
  measure();
  rejoin(report.floor_height);
  if (!followed.bones.empty()) find_near(followed);
  const int chosen = choose(report, followed);
  report.crowded = chosen >= 0 && followed.now && others_touch(chosen, report, followed.crowded);
  if (report.crowded) {
    const Component& group = components_[static_cast<std::size_t>(chosen)];
    ++report.other_components;
    if (static_cast<float>(group.voxels - group.near) * settings_.voxel * settings_.voxel >= kPersonArea) ++report.persons;
  }

  const float inside = settings_.stage_radius - 0.1f;
  for (Occupied& o : occupied_) {
    std::int32_t component = o.component;
    if (component < 0) {  // a thin voxel goes with the fullest of its neighbours
      int most = 0;
      for (int z = -1; z <= 1; ++z)
        for (int y = -1; y <= 1; ++y)
          for (int x = -1; x <= 1; ++x) {
            const std::int32_t j = index_of_[static_cast<std::size_t>(o.voxel + (z * ny_ + y) * nx_ + x)];
            if (j < 0) continue;
            const Occupied& neighbour = occupied_[static_cast<std::size_t>(j)];
            if (neighbour.component >= 0 && neighbour.points > most) most = neighbour.points, component = neighbour.component;
          }
    }
    if (component < 0) continue;
    const int group = find_group(component);
    if (components_[static_cast<std::size_t>(group)].voxels < kSpeck) continue;
    o.verdict = group == chosen && (o.near || !report.crowded) ? VoxelVerdict::person : VoxelVerdict::other;
    if (o.verdict == VoxelVerdict::person) {
      const int across = o.voxel % nx_, deep = o.voxel / nx_ / ny_;
      const float x = (static_cast<float>(across) + 0.5f) * settings_.voxel + origin_.x() - settings_.stage_x;
      const float z = (static_cast<float>(deep) + 0.5f) * settings_.voxel + origin_.z() - settings_.stage_z;
      if (x * x + z * z > inside * inside) report.touches_border = true;
    }
  }
  return chosen >= 0;
}

}  // namespace booth::fit
