// Says which limbs a cloud shows nothing of, so that a limb without points is not folded onto the points of others.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "fit/body/poser.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/cloud/point_grid.hpp"

namespace booth::fit {

/// Judges a fitted body part by part: head, upper arms, forearms with their hands, thighs, shanks, feet. A part has the support of a point that lies on it and
/// that no vertex of another part comes near to: a forearm in the trunk or along the upper arm has none, one that is crossed before the chest has. Fixed
/// buffers; one thread calls at a time; deterministic.
class PartSupport {
 public:
  /// `vertices`: of the posers that will be judged (their size()).
  explicit PartSupport(int vertices);

  /// Bones of the parts with less than 15 % of the points that their share of the surface would have. `poser` stands at the solution. Only where a cloud is
  /// all that is known: cameras say by their images what they did not see. Empty for a cloud that is too small to tell.
  /// Where two parts lie in the same points, one of them goes: the left one, or with `right_first` the right one.
  BoneSet unseen(const Poser& poser, const Cloud& cloud, bool right_first);

  std::size_t memory_bytes() const;

 private:
  static constexpr int kParts = 11, kSamples = 2000;
  PointGrid grid_;
  std::vector<float> x_;                 ///< the poser's, without the part in question
  std::array<int, kSamples> nearest_{};  ///< part whose vertex is nearest to a point, or -1
};

/// With an arm's or a leg's unseen part all of it: what else the cloud seems to show of it may be drawn from its neighbours.
BoneSet whole_limbs(BoneSet unseen);

}  // namespace booth::fit
