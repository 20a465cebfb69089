// One mutex; copies are small beside what is done with them.
#include "daemon/calibrate/newest_frames.hpp"

#include <algorithm>
#include <stdexcept>

namespace booth::daemon {

using namespace std::chrono_literals;
using Steady = std::chrono::steady_clock;

NewestFrames::NewestFrames(std::size_t cameras) : slots_(cameras) {
  for (Slot& s : slots_) s.when = Steady::now();
}

void NewestFrames::put(const hal::DepthFrame& frame) {
  const auto c = static_cast<std::size_t>(hal::to_int(frame.camera));
  const std::lock_guard lock(mutex_);
  if (c >= slots_.size()) return;
  slots_[c].frame = frame;
  slots_[c].fresh = true;
  slots_[c].when = Steady::now();
  changed_.notify_all();
}

void NewestFrames::fail(const std::string& problem) {
  const std::lock_guard lock(mutex_);
  problem_ = problem;
  changed_.notify_all();
}

bool NewestFrames::is_silent(const Slot& slot) const { return Steady::now() - slot.when > 3s; }

std::vector<hal::DepthFrame> NewestFrames::take(hal::Nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  const auto there = [this] {
    return !problem_.empty() || (std::all_of(slots_.begin(), slots_.end(), [this](const Slot& s) { return s.fresh || is_silent(s); }) &&
                                 std::any_of(slots_.begin(), slots_.end(), [](const Slot& s) { return s.fresh; }));
  };
  changed_.wait_for(lock, timeout, there);
  if (!problem_.empty()) throw std::runtime_error(problem_);
  std::vector<hal::DepthFrame> out;
  for (Slot& s : slots_)
    if (s.fresh) out.push_back(s.frame), s.fresh = false;
  return out;
}

std::vector<std::size_t> NewestFrames::silent() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::size_t> out;
  for (std::size_t c = 0; c < slots_.size(); ++c)
    if (is_silent(slots_[c])) out.push_back(c);
  return out;
}

}  // namespace booth::daemon
