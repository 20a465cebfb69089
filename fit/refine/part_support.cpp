// One grid of the whole body and one for each part without it: what lies on both is nobody's own.
#include "fit/refine/part_support.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace booth::fit {
namespace {

constexpr int kFewestPoints = 200;
constexpr float kReach = 0.10f;      // m in which a point looks for its vertex
constexpr float kOn = 0.03f;         // m before or behind a vertex's tangent plane: the point lies on the body
constexpr float kOwn = 0.04f;        // m to the nearest vertex of any other part: farther, the point is the part's own;
constexpr float kOwnDepth = 0.02f;   // so it is when it is that far from the other part's surface: a hand on a thigh is thicker
constexpr float kNormalGate = 0.2f;  // cosine between a point's and a vertex's normal
constexpr double kFewest = 0.15;     // share of the points that a part of that size would have: near joints none are its own, and a side may be hidden

consteval BoneSet bits(std::initializer_list<int> bones) {
  BoneSet out = 0;
  for (const int b : bones) out |= BoneSet{1} << b;
  return out;
}

/// In the bone order of docs/reference/skeleton.md; ends of limbs come first, since they hide what they hang on where they are folded onto it.
constexpr std::array<int, 11> kRightFirst{3, 4, 5, 0, 1, 2, 8, 9, 6, 7, 10};
constexpr std::array<BoneSet, 11> kPartBones{
    bits({4, 5}),   bits({3}),  bits({2}),  // left foot, shank, thigh
    bits({9, 10}),  bits({8}),  bits({7}),  // right
    bits({15, 16}), bits({14}),             // left forearm with the hand, upper arm
    bits({19, 20}), bits({18}),             // right
    bits({22, 23}),                         // neck and head
};

constexpr std::array<BoneSet, 4> kLimbs{kPartBones[0] | kPartBones[1] | kPartBones[2], kPartBones[3] | kPartBones[4] | kPartBones[5],
                                        kPartBones[6] | kPartBones[7], kPartBones[8] | kPartBones[9]};

int part_of(int bone) {
  for (std::size_t p = 0; p < kPartBones.size(); ++p)
    if ((kPartBones[p] >> bone & 1u) != 0) return static_cast<int>(p);
  return -1;
}

}  // namespace

PartSupport::PartSupport(int vertices) : grid_(vertices), x_(static_cast<std::size_t>(vertices)) { static_assert(kPartBones.size() == kParts); }

std::size_t PartSupport::memory_bytes() const { return sizeof(*this) + grid_.memory_bytes() + x_.size() * sizeof(float); }

BoneSet PartSupport::unseen(const Poser& poser, const Cloud& cloud, bool right_first) {
  const int count = std::min(kSamples, cloud.size), size = std::min(poser.size(), static_cast<int>(x_.size()));
  if (count < kFewestPoints) return 0;
  const auto point = [&](int s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count);
    return std::pair{Eigen::Vector3f(cloud.x[i], cloud.y[i], cloud.z[i]), Eigen::Vector3f(cloud.nx[i], cloud.ny[i], cloud.nz[i])};
  };
  const auto find = [&](const Eigen::Vector3f& p, const Eigen::Vector3f& n, float reach) {
    return n.isZero() ? grid_.nearest(p, reach) : grid_.nearest(p, reach, n, kNormalGate);
  };

  grid_.rebuild(poser.x.data(), poser.y.data(), poser.z.data(), poser.nx.data(), poser.ny.data(), poser.nz.data(), size);
  std::array<int, kParts> vertices{}, points{}, own{};
  for (int v = 0; v < size; ++v)
    if (const int p = part_of(poser.main_bone(v)); p >= 0) ++vertices[static_cast<std::size_t>(p)];
  for (int s = 0; s < count; ++s) {
    const auto [p, n] = point(s);
    const int v = find(p, n, kReach);
    const bool on = v >= 0 && std::abs(poser.normal(v).dot(poser.position(v) - p)) < kOn;
    const int part = on ? part_of(poser.main_bone(v)) : -1;
    nearest_[static_cast<std::size_t>(s)] = part;
    if (part >= 0) ++points[static_cast<std::size_t>(part)];
  }

  BoneSet out = 0;
  for (std::size_t k = 0; k < kParts; ++k) {
    const int part = right_first ? kRightFirst[k] : static_cast<int>(k);
    const auto at = static_cast<std::size_t>(part);
    const double fewest = kFewest * count * vertices[at] / size;
    if (points[at] >= fewest) {
      // A place that is no number leaves the vertex out of the grid.
      const BoneSet without = out | kPartBones[at];
      for (int v = 0; v < size; ++v)
        x_[static_cast<std::size_t>(v)] =
            (without >> poser.main_bone(v) & 1u) != 0 ? std::numeric_limits<float>::quiet_NaN() : poser.x[static_cast<std::size_t>(v)];
      grid_.rebuild(x_.data(), poser.y.data(), poser.z.data(), poser.nx.data(), poser.ny.data(), poser.nz.data(), size);
      for (int s = 0; s < count; ++s) {
        if (nearest_[static_cast<std::size_t>(s)] != part) continue;
        const auto [p, n] = point(s);
        const int v = find(p, n, kOwn);
        own[at] += v < 0 || std::abs(poser.normal(v).dot(poser.position(v) - p)) > kOwnDepth;
      }
    }
    if (own[at] < fewest) out |= kPartBones[at];
  }
  return out;
}

BoneSet whole_limbs(BoneSet unseen) {
  BoneSet out = unseen;
  for (const BoneSet limb : kLimbs)
    if ((unseen & limb) != 0) out |= limb;
  return out;
}

}  // namespace booth::fit
