// Cameras are read in step, the one that is behind first, until the frames of a group are there.
#include "daemon/record/replay.hpp"

#include <cstring>
#include <deque>
#include <stdexcept>

namespace booth::daemon {
namespace {

/// One camera's frames that were read and may still be needed.
struct Lane {
  hal::DepthCamera* camera = nullptr;
  std::deque<hal::DepthFrame> frames;
  bool ended = false;

  bool reaches(hal::MonotonicTime t) const { return ended || (!frames.empty() && frames.back().captured >= t); }
  const hal::DepthFrame* find(hal::MonotonicTime t) const {
    for (const auto& f : frames)
      if (f.captured == t) return &f;
    return nullptr;
  }
};

/// False when the camera may not go further before another one has.
bool read_one(Lane& lane, int index, hal::Nanoseconds to_live) {
  hal::DepthFrame frame;
  switch (lane.camera->read(frame, std::chrono::milliseconds(1))) {
    case hal::ReadStatus::frame:
      frame.camera = static_cast<hal::CameraIndex>(index);
      frame.captured += to_live;
      lane.frames.push_back(std::move(frame));
      return true;
    case hal::ReadStatus::timeout:
      return false;
    case hal::ReadStatus::ended:
      lane.ended = true;
      return true;
    case hal::ReadStatus::lost:
      throw std::runtime_error(lane.camera->last_error());
  }
  return false;
}

/// Reads until every camera has a frame of that instant or a later one. All cameras, also those that are not in the group: none may fall behind the others.
void read_up_to(std::vector<Lane>& lanes, hal::MonotonicTime latest, hal::Nanoseconds to_live) {
  for (bool behind = true; behind;) {
    behind = false;
    bool moved = false;
    for (std::size_t i = 0; i < lanes.size(); ++i)
      if (!lanes[i].reaches(latest)) {
        moved |= read_one(lanes[i], static_cast<int>(i), to_live);
        behind = true;
      }
    if (!behind || moved) continue;
    // Frames are missing, and the next one that there is lies further ahead than a camera may be of the others: they go first.
    for (std::size_t i = 0; i < lanes.size(); ++i)
      if (!lanes[i].ended) read_one(lanes[i], static_cast<int>(i), to_live);
  }
}

}  // namespace

ReplayCounters run_replay(hal::DepthCameras& cameras, const std::vector<hal::FittedGroup>& groups, hal::Nanoseconds to_live, FrameFitter& fitter,
                          const std::function<void(const FitInput&, const FrameRecord&)>& each) {
  std::vector<Lane> lanes(cameras.size());
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    lanes[i].camera = cameras[i].get();
    cameras[i]->start();
  }
  ReplayCounters out;
  bool known = false;
  for (const hal::FittedGroup& group : groups) {
    hal::MonotonicTime latest{}, earliest = hal::MonotonicTime::max();
    for (std::size_t i = 0; i < lanes.size(); ++i)
      if (group.captured[i] != hal::MonotonicTime{}) {
        latest = std::max(latest, group.captured[i]);
        earliest = std::min(earliest, group.captured[i]);
      }
    read_up_to(lanes, latest, to_live);
    if (group.sequence == 0) {
      known = true;
      fitter.reset();
    }
    FitInput input;
    FrameRecord record;
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      if (group.captured[i] == hal::MonotonicTime{}) continue;
      input.frames[i] = lanes[i].find(group.captured[i]);
      if (!input.frames[i]) known = false;
      record.cameras = static_cast<std::uint8_t>(record.cameras + 1);
    }
    if (!known) {
      ++out.skipped;
    } else {
      input.frame = record.sequence = group.sequence;
      input.reference = group.reference;
      record.captured_ns = group.reference.time_since_epoch().count();
      fitter.step(input, record);
      ++out.groups;
      // The bits, and not the values: that is the promise. NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
      const bool same = (record.person != PersonState::lost) == group.person && std::memcmp(record.q.data(), group.q.data(), sizeof group.q) == 0;
      out.identical += same;
      each(input, record);
    }
    // The next group may hold a frame that is a little older than the latest of this one.
    for (Lane& lane : lanes)
      while (!lane.frames.empty() && lane.frames.front().captured < earliest - std::chrono::milliseconds(100)) lane.frames.pop_front();
  }
  for (Lane& lane : lanes) lane.camera->stop();
  return out;
}

}  // namespace booth::daemon
