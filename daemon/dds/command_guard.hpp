// Decides whether a command from the network is carried out: each one once, none that is old, none from whom asks too often.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hal/time.hpp"

namespace booth::daemon {

enum class DdsCommand : std::uint8_t { start, stop, calibrate, snapshot };

struct DdsAnswer {
  bool accepted = false;
  std::uint8_t state = 0;  ///< SessionState after the command
  std::string text{};      ///< why it was refused
};

/// A command as it came in; nothing in it has been looked at but its bounds.
struct RemoteCommand {
  std::uint64_t writer = 0;  ///< which writer of the network it came from
  std::uint32_t version = 0;
  std::string sender;
  std::uint64_t id = 0;
  std::int64_t utc_ns = 0;
  std::uint32_t kind = 0;
};

struct GuardedAnswer {
  DdsAnswer answer;
  bool repeated = false;
};

/// Bounded in memory and time whatever comes in. Not thread-safe: it belongs to the thread that hears commands.
class CommandGuard {
 public:
  static constexpr std::int64_t kWindowNs = 30'000'000'000;   ///< how far a command's time may be from the booth's
  static constexpr double kPerSecond = 2, kBurst = 5;         ///< commands of one writer
  static constexpr double kAllPerSecond = 8, kAllBurst = 20;  ///< of all writers together
  static constexpr std::size_t kWriters = 64;

  using CarryOut = std::function<DdsAnswer(DdsCommand)>;
  /// `state` tells the session's state for answers that carry nothing out. Commands that were sent before `began` are refused: by
  /// the clock as it goes now, whatever it said then.
  CommandGuard(std::uint32_t version, hal::MonotonicTime began, CarryOut carry_out, std::function<std::uint8_t()> state);

  /// `utc_ns` and `now` are the booth's clocks. Nothing: not even an answer is due, because this writer asks too often.
  std::optional<GuardedAnswer> handle(const RemoteCommand& command, std::int64_t utc_ns, hal::MonotonicTime now);

  std::uint64_t ignored() const { return ignored_; }

 private:
  struct Bucket {
    std::uint64_t writer = 0;
    double tokens = 0;
    hal::MonotonicTime last{};
    bool used = false;
  };
  struct Done {
    std::string sender;
    std::uint64_t id = 0;
    std::uint32_t kind = 0;
    DdsAnswer answer;
    hal::MonotonicTime when{};
  };
  static bool take(Bucket& bucket, double rate, double burst, hal::MonotonicTime now);
  Bucket& bucket_of(std::uint64_t writer);
  std::string objection(const RemoteCommand& command, std::int64_t utc_ns, hal::MonotonicTime now) const;

  const std::uint32_t version_;
  const hal::MonotonicTime began_;
  CarryOut carry_out_;
  std::function<std::uint8_t()> state_;
  std::array<Bucket, kWriters> writers_{};
  Bucket all_{};
  std::vector<Done> done_;  ///< of the last two windows: what the rates let through in that time fits
  std::size_t next_ = 0;
  std::uint64_t ignored_ = 0;
};

}  // namespace booth::daemon
