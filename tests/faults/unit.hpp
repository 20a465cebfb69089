// Runs boothd as its systemd unit does, so that faults can be tried where no systemd is: readiness, watchdog, another start after a failure.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace booth::tests {

/// The figures of systemd/boothd.service; a test compares the two.
struct UnitRules {
  std::chrono::milliseconds watchdog{6000};  ///< WatchdogSec
  std::chrono::milliseconds restart{1000};   ///< RestartSec
  std::chrono::milliseconds abort{5000};     ///< TimeoutAbortSec
  std::vector<int> no_restart{64, 78};       ///< RestartPreventExitStatus
};

/// One service. Threads: any thread may call.
class Unit {
 public:
  using Clock = std::chrono::steady_clock;
  struct State {
    pid_t pid = -1;               ///< -1: no process at the moment
    std::uint64_t starts = 0;     ///< processes so far
    std::uint64_t watchdogs = 0;  ///< times that the watchdog ended one
    bool ready = false;           ///< this process has said READY=1
    bool failed = false;          ///< it is not tried again
    Clock::time_point ready_at{};
    int last_status = 0;  ///< of wait(2), of the process before
  };

  /// `command`: program and arguments. `folder`: for the notify socket and "boothd.log". Nothing is started yet.
  Unit(std::vector<std::string> command, std::filesystem::path folder, UnitRules rules = {});
  ~Unit();
  Unit(const Unit&) = delete;

  void start();
  /// SIGTERM, and no further start; true when the process ended with status 0 in time.
  bool stop(std::chrono::seconds limit = std::chrono::seconds(90));
  State state() const;
  /// Waits for READY of a process later than the `starts`-th.
  bool wait_ready(std::uint64_t starts, std::chrono::seconds limit) const;
  std::string log() const;

 private:
  void spawn();
  void run();
  void take_notes();
  void take_end();
  void mind_watchdog();

  const std::vector<std::string> command_;
  const std::filesystem::path folder_;
  const UnitRules rules_;
  int socket_ = -1;
  mutable std::mutex mutex_;
  State state_;
  bool wanted_ = false, end_ = false;
  Clock::time_point last_ping_{}, abort_at_{}, start_at_{};
  std::thread thread_;
};

}  // namespace booth::tests
