// Seen by two, still for a while, somewhere new.
#include "daemon/calibrate/capture_flow.hpp"

#include <algorithm>
#include <cmath>

namespace booth::daemon {
namespace {

using fit::calibrate::Rigid;

bool within(const Rigid& a, const Rigid& b, double metres, double radians) {
  return (a.translation - b.translation).norm() <= metres && fit::calibrate::angle_between(a.rotation, b.rotation) <= radians;
}

bool at_rest(const Rigid& a, const Rigid& b, const CaptureRules& rules) {
  const Eigen::Vector3d from = a.translation.normalized(), to = b.translation.normalized();
  return from.cross(to).norm() <= rules.still_direction && std::abs(a.translation.norm() - b.translation.norm()) <= rules.still_metres &&
         fit::calibrate::angle_between(a.rotation, b.rotation) <= rules.still_radians;
}

}  // namespace

/// A camera that saw the board where it came to rest sees it elsewhere now, or none of those cameras sees it any more.
bool CaptureFlow::moved(const BoardLook& look) const {
  bool still = false;
  for (const auto& now : look.seen)
    for (const auto& then : anchor_->seen) {
      if (then.camera != now.camera) continue;
      if (!at_rest(then.camera_from_board, now.camera_from_board, rules_)) return true;
      still = true;
    }
  return !still;
}

/// New for at least one camera.
bool CaptureFlow::is_new(const BoardLook& look) const {
  return std::any_of(look.seen.begin(), look.seen.end(), [&](const auto& now) {
    return std::none_of(views_.begin(), views_.end(), [&](const auto& then) {
      return then.camera == now.camera && within(then.camera_from_board, now.camera_from_board, rules_.new_metres, rules_.new_radians);
    });
  });
}

CaptureCue CaptureFlow::look(const BoardLook& look) {
  if (finished_) return CaptureCue::done;
  if (look.seen.size() < 2) {
    anchor_.reset();
    return look.wrong_board && look.seen.empty() ? CaptureCue::wrong_board : CaptureCue::search;
  }
  if (!anchor_ || moved(look)) {
    anchor_ = look;
    if (rules_.still_seconds > 0) return CaptureCue::hold_still;
  }
  if (look.seconds - anchor_->seconds < rules_.still_seconds) return CaptureCue::hold_still;
  if (!is_new(look)) return CaptureCue::elsewhere;
  views_.insert(views_.end(), look.seen.begin(), look.seen.end());
  ++taken_;
  return CaptureCue::captured;
}

}  // namespace booth::daemon
