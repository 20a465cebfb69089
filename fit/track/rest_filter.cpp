// One share for all unknowns: angles that make up for each other must not be late by different amounts.
#include "fit/track/rest_filter.hpp"

#include <algorithm>

namespace booth::fit {

const PoseVector& RestFilter::next(const PoseVector& q) {
  const PoseVector change = q - pose_;
  const double most = std::max(change.head<3>().cwiseAbs().maxCoeff() / kNoiseMove, change.tail<kDofs - 3>().cwiseAbs().maxCoeff() / kNoiseTurn);
  const double share = has_pose_ && most < 1 ? kLeast + (1 - kLeast) * most * most : 1.0;
  if (share < 1)
    pose_ += share * change;
  else
    pose_ = q;
  has_pose_ = true;
  return pose_;
}

}  // namespace booth::fit
