// Deletes what is too old or too much while nothing else happens, and writes a snapshot when something went wrong.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "hal/clock.hpp"

namespace booth::daemon {

class Housekeeper {
 public:
  struct Settings {
    std::chrono::milliseconds interval = std::chrono::minutes(30);           ///< between two looks at what there is
    std::chrono::milliseconds between_snapshots = std::chrono::minutes(10);  ///< a fault that comes again and again fills no disk
    std::function<std::vector<std::string>()> prune;                         ///< returns sentences to log
    std::function<std::string(const std::string&)> snapshot;                 ///< given a reason, returns a sentence to log; empty: none are written
    std::function<void(const std::string&)> log;
  };
  /// The thread looks at once, then at every interval.
  explicit Housekeeper(Settings settings);
  ~Housekeeper();
  Housekeeper(const Housekeeper&) = delete;

  /// Called by any thread; returns at once.
  void fault(const std::string& what);

 private:
  void run();

  const Settings settings_;
  std::mutex mutex_;
  std::condition_variable bell_;
  std::string fault_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace booth::daemon
