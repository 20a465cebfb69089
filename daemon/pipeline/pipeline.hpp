// From camera threads through the synchroniser to the fit thread: who waits for whom, and what is dropped when time is short.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "daemon/pipeline/camera_worker.hpp"
#include "daemon/pipeline/frame_fitter.hpp"
#include "daemon/pipeline/latency_histogram.hpp"
#include "daemon/pipeline/synchroniser.hpp"

namespace booth::daemon {

/// Where fitted frames go. Called on the fit thread; must return soon, allocate nothing and throw nothing.
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// Out to the world; how long it takes is the stage `publish`.
  virtual void publish(FrameRecord& record) noexcept = 0;
  /// Afterwards, with all times filled in.
  virtual void log(const FrameRecord& record) noexcept = 0;
};

struct PipelineCounters {
  std::uint64_t groups = 0;          ///< formed
  std::uint64_t groups_dropped = 0;  ///< formed but overtaken by a newer one while the fit was busy, or skipped
  std::uint64_t groups_small = 0;    ///< with fewer cameras than the minimum
  std::uint64_t fitted = 0;
  std::uint64_t frames_unmatched = 0;  ///< frames that were in no group
};

/// Everything is allocated by the constructor, which also starts the threads. Public functions are thread-safe.
class Pipeline {
 public:
  struct Settings {
    int minimum_cameras = 2;
    SynchroniserSettings synchroniser;  ///< `cameras` is filled in
  };
  /// All arguments outlive the pipeline.
  Pipeline(Settings settings, hal::DepthCameras& cameras, hal::Clock& clock, FrameFitter& fitter, FrameSink& sink);
  ~Pipeline();
  Pipeline(const Pipeline&) = delete;

  /// Begins to fit, forgetting the person, with counters and histograms at zero.
  void activate();
  /// Ends fitting. When it returns, the sink is not called any more.
  void deactivate();

  std::vector<CameraStatus> cameras() const;
  int cameras_running() const;
  bool all_ended() const;
  PipelineCounters counters() const;
  LatencySummary stage(Stage s) const { return stages_[static_cast<std::size_t>(s)].summary(); }
  LatencySummary latency() const { return latency_.summary(); }
  /// Moves as long as all threads do: the smallest advance of any of them is what the watchdog looks at.
  std::vector<std::uint64_t> progress() const;
  std::vector<MemoryItem> memory_plan() const;

 private:
  static constexpr int kGroups = 4;  ///< one being fitted, one waiting, one being filled, one on its way back

  void synchronise();
  void take_frames(Synchroniser& synchroniser, ReleasedSlots& released);
  void hand_over(const FrameGroup& group);
  void release(const ReleasedSlots& released);
  void release(const FrameGroup& group);
  void fit();
  void fit_group(const FrameGroup& group);

  Settings settings_;
  hal::Clock& clock_;
  FrameFitter& fitter_;
  FrameSink& sink_;
  Wakeup camera_bell_, group_bell_;
  std::vector<std::unique_ptr<CameraWorker>> workers_;

  std::array<FrameGroup, kGroups> groups_;
  std::array<int, kGroups> spare_groups_{};  ///< the synchroniser thread's
  int spare_count_ = 0;
  std::atomic<int> waiting_{-1};  ///< the newest group, until the fit thread takes it or a newer one replaces it
  IndexRing<int, 8> done_;

  std::mutex fitting_;           ///< held while a group is fitted, so that deactivate() can wait for it
  std::atomic<int> callers_{0};  ///< threads that want fitting_: the fit thread lets them go first
  bool active_ = false;          ///< under fitting_
  std::uint64_t sequence_ = 0;   ///< under fitting_
  std::atomic<std::uint64_t> formed_{0}, dropped_{0}, small_{0}, fitted_{0}, unmatched_{0};
  std::atomic<std::uint64_t> sync_progress_{0}, fit_progress_{0};
  std::array<LatencyHistogram, kStages> stages_;
  LatencyHistogram latency_;
  std::atomic<bool> stop_{false};
  std::thread sync_thread_, fit_thread_;
};

}  // namespace booth::daemon
