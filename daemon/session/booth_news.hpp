// Notices what changes in the booth beside the session, and says it once: cameras, who computes and who decodes, cameras off their places, buttons and light,
// credentials.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/health/repeated_log.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "hal/clock.hpp"

namespace booth::daemon {

/// Each function takes what is so now and writes log lines and events of what was otherwise at its last call; what comes and goes is counted in the log
/// instead of repeated. For one thread.
class BoothNews {
 public:
  /// Hears of each event: kind, source, text.
  using Say = std::function<void(const std::string&, const std::string&, const std::string&)>;

  BoothNews(hal::Clock& clock, Say say);

  void cameras(const std::vector<CameraStatus>& now);
  void backend(const BackendStatus& now);
  /// The sentence to complain of from now on, empty for none; nothing where the last one stands. It stays as long as the same cameras are off, so that figures
  /// that change every second do not make a new alarm of it.
  std::optional<std::string> drift(const std::vector<CameraDriftStatus>& now, const std::vector<CameraStatus>& cameras);
  void panel(const std::vector<std::string>& problems);
  /// `problem` counts days, so that it is said again every day; empty: none.
  void credentials(const std::string& problem);

 private:
  void decoders(const std::vector<CameraStatus>& now);
  void changed_hands(const std::string& what, const std::string& source, const std::string& name, const std::string& problem);

  hal::Clock& clock_;
  const Say say_;
  std::vector<CameraState> camera_states_;
  std::vector<std::string> camera_problems_, panel_problems_;
  RepeatedLog camera_log_, panel_log_;  ///< one line for each cause; repetitions are counted
  BackendStatus backend_;
  std::vector<hal::DecodeStatus> decoders_;
  std::vector<CameraDriftStatus::Verdict> drift_;
  std::string credentials_;
};

}  // namespace booth::daemon
