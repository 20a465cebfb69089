// Tries every buffered frame as the earliest of a group and keeps the best instant.
#include "daemon/pipeline/synchroniser.hpp"

#include <algorithm>
#include <stdexcept>

namespace booth::daemon {

using hal::MonotonicTime;
using hal::Nanoseconds;

Synchroniser::Synchroniser(SynchroniserSettings settings) : settings_(settings) {
  if (settings.cameras < 1 || settings.cameras > kMaxCameras) throw std::invalid_argument("Synchroniser: the number of cameras must be 1 to 8");
}

void Synchroniser::remove(Lane& lane, int count) {
  std::move(lane.frame.begin() + count, lane.frame.begin() + lane.count, lane.frame.begin());
  lane.count -= count;
}

void Synchroniser::drop_front(int camera, ReleasedSlots& released) {
  Lane& lane = lanes_[static_cast<std::size_t>(camera)];
  released.push(camera, lane.frame[0].slot);
  remove(lane, 1);
  ++lane.unused;
  ++frames_dropped_;
}

/// Ahead of `now` alone is no fault: a recording that is played as fast as it can be read has its own time, but all of its cameras have the same.
bool Synchroniser::from_the_future(const FrameStamp& stamp, MonotonicTime now) const {
  const MonotonicTime limit = stamp.captured - settings_.ahead;
  if (limit <= now) return false;
  bool others = false;
  for (int cam = 0; cam < settings_.cameras; ++cam) {
    const Lane& lane = lanes_[static_cast<std::size_t>(cam)];
    if (cam == stamp.camera || !lane.heard) continue;
    if (limit <= lane.last) return false;
    others = true;
  }
  const Lane& own = lanes_[static_cast<std::size_t>(stamp.camera)];
  return others || !own.heard || limit > own.last;
}

void Synchroniser::add(const FrameStamp& stamp, MonotonicTime now, ReleasedSlots& released) {
  Lane& lane = lanes_[static_cast<std::size_t>(stamp.camera)];
  if ((lane.heard && stamp.captured <= lane.last) || from_the_future(stamp, now)) {
    released.push(stamp.camera, stamp.slot);
    ++frames_dropped_;
    return;
  }
  if (!started_) {
    first_ = newest_ = stamp.captured;
    started_ = true;
  }
  if (settings_.order == GroupOrder::newest_first && groups_ > 0 && stamp.captured <= last_reference_) {
    // Its group has gone without it, and one of late frames alone would take the fit back in time. It is heard all the same: the next group waits for it.
    lane.last = stamp.captured;
    lane.heard = true;
    released.push(stamp.camera, stamp.slot);
    ++frames_dropped_;
    return;
  }
  if (lane.count == kDepth) drop_front(stamp.camera, released);
  lane.frame[static_cast<std::size_t>(lane.count++)] = stamp;
  lane.last = stamp.captured;
  lane.heard = true;
  newest_ = std::max(newest_, stamp.captured);
}

Synchroniser::Candidate Synchroniser::candidate_from(MonotonicTime earliest) const {
  Candidate c;
  c.earliest = earliest;
  c.index.fill(-1);
  const MonotonicTime end = earliest + 2 * settings_.window;
  // First the earliest frame of each camera in the window gives the instant ...
  MonotonicTime latest = earliest;
  for (int cam = 0; cam < settings_.cameras; ++cam) {
    const Lane& lane = lanes_[static_cast<std::size_t>(cam)];
    for (int i = 0; i < lane.count; ++i) {
      const MonotonicTime t = lane.frame[static_cast<std::size_t>(i)].captured;
      if (t < earliest || t > end) continue;
      c.index[static_cast<std::size_t>(cam)] = i;
      latest = std::max(latest, t);
      ++c.cameras;
      break;
    }
  }
  c.span = latest - earliest;
  c.reference = earliest + c.span / 2;
  // ... then each camera gives the frame nearest to it, which is never farther than the first choice.
  for (int cam = 0; cam < settings_.cameras; ++cam) {
    int& chosen = c.index[static_cast<std::size_t>(cam)];
    if (chosen < 0) continue;
    const Lane& lane = lanes_[static_cast<std::size_t>(cam)];
    const auto distance = [&](int i) { return std::chrono::abs(lane.frame[static_cast<std::size_t>(i)].captured - c.reference); };
    for (int i = chosen + 1; i < lane.count; ++i) {
      if (distance(i) < distance(chosen)) chosen = i;
    }
  }
  return c;
}

bool Synchroniser::better(const Candidate& a, const Candidate& b) const {
  if (a.cameras != b.cameras) return a.cameras > b.cameras;
  if (a.reference != b.reference) return settings_.order == GroupOrder::newest_first ? a.reference > b.reference : a.reference < b.reference;
  return a.span < b.span;
}

int Synchroniser::living(MonotonicTime newest) const {
  int count = 0;
  for (int cam = 0; cam < settings_.cameras; ++cam) {
    const Lane& lane = lanes_[static_cast<std::size_t>(cam)];
    count += newest - (lane.heard ? lane.last : first_) <= settings_.silence;
  }
  return count;
}

Synchroniser::Candidate Synchroniser::best_candidate(MonotonicTime oldest, MonotonicTime deadline) const {
  Candidate best;
  for (int cam = 0; cam < settings_.cameras; ++cam) {
    const Lane& lane = lanes_[static_cast<std::size_t>(cam)];
    for (int i = 0; i < lane.count; ++i) {
      const MonotonicTime t = lane.frame[static_cast<std::size_t>(i)].captured;
      // Offline, a later group waits its turn: only one that could hold the oldest frame's neighbours is next.
      if (settings_.order == GroupOrder::oldest_first && t > oldest + 2 * settings_.window) break;
      const Candidate c = candidate_from(t);
      if (c.reference + settings_.window <= deadline && (best.cameras == 0 || better(c, best))) best = c;
    }
  }
  return best;
}

bool Synchroniser::next(MonotonicTime now, FrameGroup& group, ReleasedSlots& released) {
  MonotonicTime oldest = MonotonicTime::max();
  for (const Lane& lane : lanes_) {
    if (lane.count > 0) oldest = std::min(oldest, lane.frame[0].captured);
  }
  if (oldest == MonotonicTime::max()) return false;

  Candidate best = best_candidate(oldest, MonotonicTime::max());
  if (best.cameras < living(newest_) && now != MonotonicTime::max()) {
    // Not all are in. Only what has waited long enough may go: the newest candidate is always too young, and would hold back the others for ever.
    best = best_candidate(oldest, now - settings_.patience);
    if (best.cameras == 0) return false;
  }

  group = {};
  group.number = groups_++;
  group.reference = last_reference_ = best.reference;
  group.cameras = best.cameras;
  group.slot.fill(-1);
  std::uint64_t skipped = UINT64_MAX;
  for (int cam = 0; cam < settings_.cameras; ++cam) {
    Lane& lane = lanes_[static_cast<std::size_t>(cam)];
    const int chosen = best.index[static_cast<std::size_t>(cam)];
    if (chosen >= 0) {
      for (int i = 0; i < chosen; ++i) drop_front(cam, released);
      group.slot[static_cast<std::size_t>(cam)] = lane.frame[0].slot;
      group.captured[static_cast<std::size_t>(cam)] = lane.frame[0].captured;
      remove(lane, 1);
      skipped = std::min(skipped, lane.unused);
      lane.unused = 0;
    } else {
      while (lane.count > 0 && lane.frame[0].captured < best.earliest) drop_front(cam, released);
    }
  }
  group.skipped = skipped;
  return true;
}

}  // namespace booth::daemon
