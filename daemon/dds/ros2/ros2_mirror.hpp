// What a booth shows of its person, said once more as ROS 2 says it: on a thread of its own, so that it costs the fit a copy.
#pragma once

#include <dds/dds.h>

#include <cstdint>
#include <memory>
#include <string>

#include "daemon/dds/dds_settings.hpp"
#include "daemon/pipeline/frame_record.hpp"
#include "fit/cloud/observation.hpp"
#include "hal/clock.hpp"

namespace booth::daemon {

/// Topics, frames and rates: docs/reference/ros2.md. Publishes the cameras' frames at once, everything else as it comes.
class Ros2Mirror {
 public:
  static constexpr std::int64_t kCloudPeriodNs = 200'000'000;      ///< at most five clouds a second
  static constexpr std::int64_t kTrackedPeriodNs = 1'000'000'000;  ///< who is there is said on change and so often

  /// `participant` and `clock` outlive the mirror. Throws as dds_check().
  Ros2Mirror(dds_entity_t participant, const std::string& booth, const Ros2Settings& settings, hal::Clock& clock);
  ~Ros2Mirror();
  Ros2Mirror(const Ros2Mirror&) = delete;

  /// The points of the frame that will be published next; the same thread calls publish() with it. CMU frame. Copies some of them (Ros2Cloud) when a
  /// cloud is due; waits for nobody and allocates nothing.
  void offer_cloud(const fit::Cloud& cloud, std::int64_t captured_ns) noexcept;
  /// A fitted frame. Copies it; waits for nobody and allocates nothing. One thread at a time, for this and the next.
  void publish(const FrameRecord& frame) noexcept;
  /// Nobody is captured.
  void publish_idle(std::int64_t utc_ns) noexcept;

  /// Samples that DDS refused, its last reason (a negative code, 0 when there was none), and frames that were overtaken by the next before they were sent.
  std::uint64_t failures() const;
  int last_failure() const;
  std::uint64_t frames_skipped() const;

  static std::size_t memory_bytes();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace booth::daemon
