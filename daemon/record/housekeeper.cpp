// One thread that mostly sleeps; what it does may wait for the disk, and nobody waits for it.
#include "daemon/record/housekeeper.hpp"

#include <pthread.h>

#include <optional>

namespace booth::daemon {

Housekeeper::Housekeeper(Settings settings) : settings_(std::move(settings)), thread_([this] { run(); }) {}

Housekeeper::~Housekeeper() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  bell_.notify_all();
  thread_.join();
}

void Housekeeper::fault(const std::string& what) {
  {
    const std::lock_guard lock(mutex_);
    if (fault_.empty()) fault_ = what;
  }
  bell_.notify_all();
}

void Housekeeper::run() {
  ::pthread_setname_np(::pthread_self(), "housekeeper");
  using Clock = std::chrono::steady_clock;
  Clock::time_point next_look = Clock::now();
  std::optional<Clock::time_point> last_snapshot;
  while (true) {
    std::string fault;
    {
      std::unique_lock lock(mutex_);
      bell_.wait_until(lock, next_look, [&] { return stop_ || !fault_.empty(); });
      if (stop_) return;
      fault.swap(fault_);
    }
    const auto now = Clock::now();
    if (!fault.empty() && settings_.snapshot && (!last_snapshot || now - *last_snapshot >= settings_.between_snapshots)) {
      last_snapshot = now;
      settings_.log(settings_.snapshot(fault));
    }
    if (now < next_look) continue;
    next_look = now + settings_.interval;
    try {
      for (const auto& line : settings_.prune()) settings_.log(line);
    } catch (const std::exception& e) {  // nobody waits for this thread, and nobody is to end because of it
      settings_.log(std::string("what is too old or too much could not be looked for: ") + e.what());
    }
  }
}

}  // namespace booth::daemon
