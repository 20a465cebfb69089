// boothd's side of DDS: publishes skeletons, bodies, status and events, and hears commands. Knows nothing of sessions or fits.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "hal/clock.hpp"

namespace booth::daemon {

struct DdsSettings {
  std::string booth = "booth";
  std::uint32_t domain = 0;
  std::string interface;  ///< empty: the library chooses
  bool multicast = true;
  std::vector<std::string> peers;
};

/// Cyclone DDS's own configuration for these settings, as XML (what CYCLONEDDS_URI would hold).
std::string dds_configuration(const DdsSettings& settings);

struct BodySample {
  std::string session, model_version;
  RecordSex sex = RecordSex::men;
  std::vector<double> beta;                                  ///< at most kRecordShape
  std::array<double, kRecordJoints> bone_lengths{};          ///< metres
  std::vector<std::pair<std::string, double>> measurements;  ///< at most 32
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
  std::string session, alarm;
  std::vector<Camera> cameras;  ///< at most 8
  std::uint64_t frames = 0, groups_dropped = 0;
  float fps = 0, latency_p50_ms = 0, latency_p99_ms = 0, residual = 0;
};

enum class DdsCommand : std::uint8_t { start, stop };

struct DdsAnswer {
  bool accepted = false;
  std::uint8_t state = 0;  ///< SessionState after the command
  std::string text;        ///< why it was refused
};

/// Topics, types and quality of service: docs/reference/dds.md. Public functions are thread-safe; none waits for a reader.
class DdsLink {
 public:
  /// `on_command` is called on a thread of the link's own. Throws std::runtime_error naming what DDS refused and which key to look at.
  DdsLink(const DdsSettings& settings, hal::Clock& clock, std::function<DdsAnswer(DdsCommand)> on_command);
  ~DdsLink();
  DdsLink(const DdsLink&) = delete;

  /// A fitted frame. Allocates nothing of ours.
  void publish(const FrameRecord& frame) noexcept;
  /// The skeleton topic's sign of life while nobody is captured.
  void publish_idle(std::uint8_t session_state) noexcept;
  void publish(const BodySample& body);
  void publish(const StatusSample& status);
  /// Texts longer than the topic's bounds are cut.
  void publish_event(const std::string& kind, const std::string& source, const std::string& text);

  /// Samples that DDS refused, and its last reason.
  std::uint64_t failures() const;
  std::string last_failure() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace booth::daemon
