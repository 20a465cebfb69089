// Decides which frames of free-running cameras belong to one moment.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "hal/time.hpp"

namespace booth::daemon {

inline constexpr int kMaxCameras = 8;

enum class GroupOrder : std::uint8_t {
  newest_first,  ///< live: the newest complete group wins, what is older is dropped
  oldest_first,  ///< offline: one group after the other
};

struct SynchroniserSettings {
  int cameras = 4;
  GroupOrder order = GroupOrder::newest_first;
  hal::Nanoseconds window = std::chrono::milliseconds(15);    ///< most that a frame may lie from its group's reference instant
  hal::Nanoseconds patience = std::chrono::milliseconds(60);  ///< how long after its window an incomplete group waits: a loaded machine delivers late
  hal::Nanoseconds silence = std::chrono::milliseconds(150);  ///< a camera that is silent for longer is not waited for
  hal::Nanoseconds ahead = std::chrono::milliseconds(200);    ///< most that a stamp may lie ahead of the clock: a calibration takes 50 ms off one, no more
};

struct FrameStamp {
  int camera = 0;
  hal::MonotonicTime captured{};
  int slot = 0;  ///< the caller's buffer; handed back in a group or as released
};

struct FrameGroup {
  std::uint64_t number = 0;             ///< counts the groups
  hal::MonotonicTime reference{};       ///< every frame lies within the window of it
  std::array<int, kMaxCameras> slot{};  ///< -1: this camera is not in
  std::array<hal::MonotonicTime, kMaxCameras> captured{};
  int cameras = 0;            ///< how many are in
  std::uint64_t skipped = 0;  ///< groups lost since the last one: frames that every camera of this one had and nobody used
};

/// Buffers that nobody needs any more.
struct ReleasedSlots {
  struct Entry {
    int camera, slot;
  };
  std::array<Entry, 2 * kMaxCameras * 4> entry{};
  int count = 0;
  void push(int camera, int slot) { entry[static_cast<std::size_t>(count++)] = {camera, slot}; }
  std::span<const Entry> list() const { return {entry.data(), static_cast<std::size_t>(count)}; }
};

/// Pure: no threads, no clock, no allocation. The rule (docs/design/pipeline.md): among all instants, the one within 15 ms of which most cameras have
/// a frame; a group of all living cameras goes out at once, a smaller one when its missing frames are overdue.
class Synchroniser {
 public:
  static constexpr int kDepth = 4;  ///< frames remembered for each camera

  /// Throws std::invalid_argument when the number of cameras is not 1 to kMaxCameras.
  explicit Synchroniser(SynchroniserSettings settings);

  /// A new frame that has come at `now` (MonotonicTime::max() where no clock runs along). Frames of one camera come in order of time; one that does not is
  /// released, and so is (newest first) one from before the last group's reference instant: references only ever grow. Likewise one from the future, ahead of
  /// `now` and of the other cameras: it would make all of their frames old until its time has come. Released slots are appended.
  void add(const FrameStamp& stamp, hal::MonotonicTime now, ReleasedSlots& released);

  /// The next group that is due at `now`, if any (MonotonicTime::max() when nothing more will come). Call until false after each add() and whenever time has
  /// passed, with an empty `released`: slots of frames that no group can use any more are appended to it.
  bool next(hal::MonotonicTime now, FrameGroup& group, ReleasedSlots& released);

  /// Frames that came in but were in no group.
  std::uint64_t frames_dropped() const { return frames_dropped_; }

 private:
  struct Lane {
    std::array<FrameStamp, kDepth> frame{};
    int count = 0;
    hal::MonotonicTime last{};  ///< newest frame ever
    bool heard = false;
    std::uint64_t unused = 0;  ///< frames dropped since the last group that this camera was in
  };
  struct Candidate {
    std::array<int, kMaxCameras> index{};
    int cameras = 0;
    hal::MonotonicTime reference{}, earliest{};
    hal::Nanoseconds span{};
  };

  bool from_the_future(const FrameStamp& stamp, hal::MonotonicTime now) const;
  Candidate candidate_from(hal::MonotonicTime earliest) const;
  /// The best group; with a deadline, of those whose window ended before it. `cameras` is 0 when there is none.
  Candidate best_candidate(hal::MonotonicTime oldest, hal::MonotonicTime deadline) const;
  bool better(const Candidate& a, const Candidate& b) const;
  int living(hal::MonotonicTime newest) const;
  void drop_front(int camera, ReleasedSlots& released);
  void remove(Lane& lane, int count);

  SynchroniserSettings settings_;
  std::array<Lane, kMaxCameras> lanes_{};
  hal::MonotonicTime first_{}, newest_{}, last_reference_{};
  bool started_ = false;
  std::uint64_t groups_ = 0, frames_dropped_ = 0;
};

}  // namespace booth::daemon
