// The table, and the gate that keeps cameras from resetting together.
#include "drivers/kinect2/recovery_ladder.hpp"

#include <algorithm>

namespace booth::drivers::kinect2 {
namespace {
constexpr int kGoodFrames = 100;
constexpr int kLast = static_cast<int>(Rung::ask_for_help);
}  // namespace

std::string_view to_string(Rung rung) {
  switch (rung) {
    case Rung::restart_stream:
      return "restart the stream";
    case Rung::reopen:
      return "reset and reopen";
    case Rung::reboot:
      return "reboot the device";
    case Rung::reset_port:
      return "reset the port";
    case Rung::rebind_controller:
      return "bind the controller anew";
    case Rung::ask_for_help:
      return "reopen, and ask for a replug";
  }
  return "?";
}

Rung RecoveryLadder::after(Trouble trouble) {
  good_ = 0;
  ++tried_;
  if (trouble == Trouble::vanished) {
    next_ = static_cast<int>(Rung::reboot);
    return Rung::reopen;
  }
  if (trouble == Trouble::absent) next_ = std::max(next_, static_cast<int>(Rung::reset_port));
  if (trouble == Trouble::failed) next_ = std::max(next_, static_cast<int>(Rung::reopen));
  if (trouble == Trouble::not_ready) next_ = std::max(next_, static_cast<int>(Rung::reboot));
  const auto rung = static_cast<Rung>(next_);
  next_ = std::min(next_ + 1, kLast);
  return rung;
}

void RecoveryLadder::delivered() {
  if (tried_ == 0 || ++good_ < kGoodFrames) return;
  next_ = tried_ = good_ = 0;
}

bool ResetGate::enter(hal::MonotonicTime now) {
  const std::lock_guard lock(mutex_);
  if (now < next_) return false;
  next_ = now + spacing_;
  return true;
}

}  // namespace booth::drivers::kinect2
