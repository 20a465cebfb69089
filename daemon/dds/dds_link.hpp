// boothd's side of DDS: publishes skeletons, bodies, status and events, and hears commands. Knows nothing of sessions or fits.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/dds/command_guard.hpp"
#include "daemon/dds/dds_settings.hpp"
#include "daemon/pipeline/frame_record.hpp"
#include "hal/clock.hpp"

namespace booth::fit {
class Cloud;
}

namespace booth::daemon {

struct BodySample {
  std::string session, model_version;
  RecordSex sex = RecordSex::men;
  struct Measurement {
    std::string name, unit;
    double value = 0, deviation = -1;  ///< one standard deviation; negative: not known
  };
  std::vector<double> beta;                          ///< at most kRecordShape
  std::array<double, kRecordJoints> bone_lengths{};  ///< metres
  std::vector<Measurement> measurements;             ///< at most 32
};

struct StatusSample {
  struct Camera {
    std::string name, state;
    float fps = 0;
    std::uint64_t delivered = 0, dropped = 0;
    std::uint32_t restarts = 0;
  };
  std::uint8_t state = 0;  ///< SessionState
  bool degraded = false, paused = false, latched = false;
  std::string software, session, alarm;
  std::vector<std::pair<std::string, std::string>> faults;  ///< source and sentence; at most 8
  std::vector<Camera> cameras;                              ///< at most 8
  std::uint64_t frames = 0, groups_dropped = 0;
  float fps = 0, latency_p50_ms = 0, latency_p99_ms = 0, residual = 0;
  double calibration_age_s = -1, calibration_residual = -1;  ///< negative: not known
  std::int64_t disk_free_bytes = -1, disk_total_bytes = -1;  ///< negative: not known
};

/// Topics, types and quality of service: docs/reference/dds.md. Public functions are thread-safe; none waits for a reader.
class DdsLink {
 public:
  /// `on_command` is called on a thread of the link's own, at most 8 times a second, for commands that CommandGuard lets through. Throws std::runtime_error
  /// naming what DDS refused and which key to look at.
  DdsLink(const DdsSettings& settings, hal::Clock& clock, std::function<DdsAnswer(DdsCommand)> on_command);
  ~DdsLink();
  DdsLink(const DdsLink&) = delete;

  /// The points of the frame that the calling thread will publish next, CMU frame, for those who want them: the ROS 2 mirror, where it is on. Allocates
  /// nothing.
  void offer_cloud(const fit::Cloud& cloud, std::int64_t captured_ns) noexcept;
  /// A fitted frame. Allocates nothing of ours.
  void publish(const FrameRecord& frame) noexcept;
  /// The skeleton topic's sign of life while nobody is captured.
  void publish_idle(std::uint8_t session_state) noexcept;
  void publish(const BodySample& body);
  void publish(const StatusSample& status);
  /// Texts longer than the topic's bounds are cut.
  void publish_event(const std::string& kind, const std::string& source, const std::string& text);

  /// Commands that were not even answered, because their senders ask too often.
  std::uint64_t commands_ignored() const;
  /// Samples that DDS refused, and its last reason.
  std::uint64_t failures() const;
  std::string last_failure() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace booth::daemon
