// One recording in work: a thread that takes moments out of the memory and puts them into a bag.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "drivers/recording/moment_ring.hpp"
#include "hal/clock.hpp"
#include "hal/flight_recorder.hpp"
#include "hal/sealed_file.hpp"

namespace booth::drivers {

/// What all recordings of a booth share; outlives them.
struct RecordingContext {
  const MomentRing& ring;
  hal::Clock& clock;
  const std::vector<hal::CameraDescription>& cameras;
  const std::vector<hal::DepthFrame>& background;
  std::uint64_t keep_free_bytes = 0;
  hal::SealFiles seal{};           ///< empty: recordings are plain
  std::function<void()> settle{};  ///< waits until what was handed in before is in the ring
};

struct RecordingOrder {
  std::filesystem::path path;
  bool depth = false, uncompressed = false;
  MomentRing::Cursor from;
  std::optional<std::uint64_t> until;  ///< number of the first moment that is not written any more; a snapshot knows it
  double seconds = 0;                  ///< else it ends by time
  hal::Nanoseconds patience{};         ///< and, where not zero, when it is not asked after for so long
  std::string reason;
};

class RecordingJob {
 public:
  RecordingJob(const RecordingContext& context, RecordingOrder order);
  ~RecordingJob();
  RecordingJob(const RecordingJob&) = delete;

  bool running() const { return running_.load(std::memory_order_acquire); }
  void stop() { stop_ = true; }
  void asked() { asked_ns_ = context_.clock.now().time_since_epoch().count(); }
  hal::RecordingStatus status() const;

 private:
  void run();
  void write();
  /// Why it ends now, empty while it goes on.
  std::string over(hal::MonotonicTime now) const;
  /// Throws when the disk is nearly full.
  void check_space(const std::filesystem::path& folder) const;

  const RecordingContext context_;
  const RecordingOrder order_;
  hal::MonotonicTime began_{};
  std::atomic<std::int64_t> asked_ns_{0};
  std::atomic<bool> stop_{false}, running_{true};
  mutable std::mutex mutex_;
  hal::RecordingStatus status_;  ///< under mutex_
  std::thread thread_;
};

}  // namespace booth::drivers
