// Reads whichever camera is behind, so that frames enter the synchroniser in the order in which they were taken.
#include "daemon/pipeline/offline_run.hpp"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <vector>

namespace booth::daemon {
namespace {

/// One camera's frames: some in the synchroniser or in a group, one read ahead.
struct Feed {
  hal::DepthCamera* camera = nullptr;
  std::vector<hal::DepthFrame> slots{Synchroniser::kDepth + 2};
  std::vector<int> free;
  int ahead = -1;  ///< slot of the frame that was read but not given to the synchroniser
  bool ended = false;
};

/// Reads the next frame of a feed that has none ahead. False: its camera does not give it yet.
bool read_ahead(Feed& feed, int index, std::chrono::milliseconds timeout) {
  if (feed.ended || feed.ahead >= 0) return true;
  const int slot = feed.free.back();
  hal::DepthFrame& frame = feed.slots[static_cast<std::size_t>(slot)];
  switch (feed.camera->read(frame, timeout)) {
    case hal::ReadStatus::frame:
      frame.camera = static_cast<hal::CameraIndex>(index);
      feed.free.pop_back();
      feed.ahead = slot;
      return true;
    case hal::ReadStatus::timeout:
      return false;
    case hal::ReadStatus::ended:
      feed.ended = true;
      return true;
    case hal::ReadStatus::lost:
      throw std::runtime_error(feed.camera->last_error());
  }
  return false;
}

class OfflineRun {
 public:
  OfflineRun(hal::DepthCameras& cameras, int minimum, FrameFitter& fitter, const std::function<bool(const FitInput&, const FrameRecord&)>& each)
      : minimum_(minimum), fitter_(fitter), each_(each), synchroniser_({.cameras = static_cast<int>(cameras.size()), .order = GroupOrder::oldest_first}) {
    for (auto& camera : cameras) {
      Feed feed;
      feed.camera = camera.get();
      for (int s = 0; s < static_cast<int>(feed.slots.size()); ++s) feed.free.push_back(s);
      feeds_.push_back(std::move(feed));
    }
  }
  ~OfflineRun() {
    for (auto& feed : feeds_) feed.camera->stop();
  }

  OfflineCounters run() {
    for (auto& feed : feeds_) feed.camera->start();
    fitter_.reset();
    while (true) {
      read_all_ahead();
      Feed* first = nullptr;
      for (auto& feed : feeds_) {
        if (feed.ahead >= 0 && (!first || captured(feed) < captured(*first))) first = &feed;
      }
      const hal::MonotonicTime now = first ? captured(*first) : hal::MonotonicTime::max();
      if (first) {
        ++counters_.frames;
        ReleasedSlots released;
        synchroniser_.add({static_cast<int>(first - feeds_.data()), now, first->ahead}, hal::MonotonicTime::max(), released);
        first->ahead = -1;
        release(released);
      }
      if (!groups_until(now)) break;
      if (!first) break;
    }
    counters_.frames_unmatched = synchroniser_.frames_dropped();
    return counters_;
  }

 private:
  /// A camera that gives nothing yet waits for the others: at Pace::fast none runs far ahead of another, so after a gap its next frame lies later than all of
  /// theirs. Where nobody gives anything it is the disk that is slow.
  void read_all_ahead() {
    constexpr int kPatience = 300;  // times 100 ms
    for (int turn = 0; turn <= kPatience; ++turn) {
      const Feed* waits = nullptr;
      bool any = false;
      for (std::size_t i = 0; i < feeds_.size(); ++i) {
        if (!read_ahead(feeds_[i], static_cast<int>(i), std::chrono::milliseconds(turn == 0 ? 0 : 100))) waits = &feeds_[i];
        any |= feeds_[i].ahead >= 0;
      }
      if (any || !waits) return;
      if (turn == kPatience) throw std::runtime_error("camera " + waits->camera->description().name + " gave no frame for 30 s");
    }
  }

  hal::MonotonicTime captured(const Feed& feed) const { return feed.slots[static_cast<std::size_t>(feed.ahead)].captured; }

  void release(const ReleasedSlots& released) {
    for (const auto& entry : released.list()) feeds_[static_cast<std::size_t>(entry.camera)].free.push_back(entry.slot);
  }

  /// False when the caller has seen enough.
  bool groups_until(hal::MonotonicTime now) {
    FrameGroup group;
    while (true) {
      ReleasedSlots released;
      const bool more = synchroniser_.next(now, group, released);
      release(released);
      if (!more) return true;
      const bool go_on = group.cameras < minimum_ ? (++counters_.groups_small, true) : fit(group);
      for (std::size_t cam = 0; cam < feeds_.size(); ++cam) {
        if (group.slot[cam] >= 0) feeds_[cam].free.push_back(group.slot[cam]);
      }
      if (!go_on) return false;
    }
  }

  bool fit(const FrameGroup& group) {
    FitInput input;
    FrameRecord record;
    input.frame = record.sequence = counters_.groups++;
    input.reference = group.reference;
    for (std::size_t cam = 0; cam < feeds_.size(); ++cam) {
      if (group.slot[cam] >= 0) input.frames[cam] = &feeds_[cam].slots[static_cast<std::size_t>(group.slot[cam])];
    }
    record.cameras = static_cast<std::uint8_t>(group.cameras);
    record.captured_ns = group.reference.time_since_epoch().count();
    fitter_.step(input, record);
    return each_(input, record);
  }

  const int minimum_;
  FrameFitter& fitter_;
  const std::function<bool(const FitInput&, const FrameRecord&)>& each_;
  Synchroniser synchroniser_;
  std::vector<Feed> feeds_;
  OfflineCounters counters_;
};

}  // namespace

OfflineCounters run_offline(hal::DepthCameras& cameras, int minimum_cameras, FrameFitter& fitter,
                            const std::function<bool(const FitInput&, const FrameRecord&)>& each) {
  return OfflineRun(cameras, minimum_cameras, fitter, each).run();
}

}  // namespace booth::daemon
