// Says each trouble once and counts its repetitions, so that a camera that dies every few seconds does not fill the journal.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>

#include "daemon/health/log.hpp"
#include "hal/time.hpp"

namespace booth::daemon {

/// A cause is a sentence without its numbers: what differs only in a count or a status word is the same trouble. Thread-safe; a fixed number of causes is
/// remembered, then the one that was silent for longest is forgotten.
class RepeatedLog {
 public:
  using Write = std::function<void(LogLevel, const std::string&)>;
  explicit RepeatedLog(hal::Nanoseconds window = std::chrono::minutes(10), Write write = log_line) : window_(window), write_(std::move(write)) {}
  ~RepeatedLog() { tell({}, true); }  ///< what was only counted is told at the end
  RepeatedLog(const RepeatedLog&) = delete;

  /// Written at once when its cause is new or was not written for the window's length; counted otherwise. True when it was written.
  bool say(LogLevel level, const std::string& sentence, hal::MonotonicTime now);
  /// Writes how often each cause came again since it was written, for those whose window is over; all of them at `everything`.
  void tell(hal::MonotonicTime now, bool everything = false);

 private:
  struct Cause {
    std::string key, sentence;
    LogLevel level = LogLevel::info;
    hal::MonotonicTime written{}, seen{};
    std::uint64_t again = 0;
  };
  void tell_one(Cause& cause);
  Cause& find(const std::string& key);

  static constexpr std::size_t kCauses = 128;
  const hal::Nanoseconds window_;
  const Write write_;
  std::mutex mutex_;
  std::array<Cause, kCauses> causes_;
};

}  // namespace booth::daemon
