// The hand-over of tasks: one atomic ticket, a short spin, then a futex through std::atomic::wait.
#include "fit/parallel.hpp"

#include <stdexcept>
#include <string>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace booth::fit {
namespace {

// Some tens of us: the gap between two runs of one frame, and what equal shares of one differ by. Longer waits sleep, and waking takes as long again.
constexpr int kSpins = 1500;

void pause() {
#if defined(__x86_64__)
  _mm_pause();
#elif defined(__aarch64__)
  __asm__ __volatile__("yield");
#endif
}

template <typename Predicate>
bool spin_until(Predicate ready) {
  for (int i = 0; i < kSpins; ++i) {
    if (ready()) return true;
    pause();
  }
  return false;
}

}  // namespace

WorkerPool::WorkerPool(int threads) {
  if (threads < 1 || threads > 256) throw std::invalid_argument("worker pool: " + std::to_string(threads) + " threads asked for; give 1 to 256");
  workers_.reserve(static_cast<std::size_t>(threads - 1));
  try {
    for (int i = 1; i < threads; ++i) workers_.emplace_back([this] { work(); });
  } catch (...) {  // the threads that did start must end before their handles go
    stop_.store(true);
    epoch_.fetch_add(1);
    epoch_.notify_all();
    for (auto& w : workers_) w.join();
    throw;
  }
}

WorkerPool::~WorkerPool() {
  stop_.store(true);
  epoch_.fetch_add(1);
  epoch_.notify_all();
  for (auto& w : workers_) w.join();
}

bool WorkerPool::take_one() {
  std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
  do {
    if (static_cast<std::uint32_t>(ticket) == 0) return false;
  } while (!ticket_.compare_exchange_weak(ticket, ticket - 1, std::memory_order_acq_rel, std::memory_order_acquire));
  const int tasks = tasks_;
  (*body_)(tasks - static_cast<int>(static_cast<std::uint32_t>(ticket)));
  if (done_.fetch_add(1, std::memory_order_acq_rel) + 1 == tasks) done_.notify_one();
  return true;
}

void WorkerPool::work() {
#if defined(__linux__)
  ::pthread_setname_np(::pthread_self(), "frame-worker");  // for top -H, and for whoever counts what threads of the frame path allocate; <thread> brings it
#endif
  while (true) {
    const int seen = epoch_.load(std::memory_order_acquire);
    if (stop_.load(std::memory_order_acquire)) return;
    while (take_one()) {
    }
    if (!spin_until([&] { return epoch_.load(std::memory_order_acquire) != seen; })) epoch_.wait(seen, std::memory_order_acquire);
  }
}

void WorkerPool::run(int tasks, FunctionRef<void(int)> body) {
  if (tasks <= 0) return;
  if (tasks == 1 || workers_.empty()) {
    for (int task = 0; task < tasks; ++task) body(task);
    return;
  }
  body_ = &body;
  tasks_ = tasks;
  done_.store(0, std::memory_order_relaxed);
  ticket_.store((static_cast<std::uint64_t>(++run_) << 32) | static_cast<std::uint32_t>(tasks), std::memory_order_release);
  epoch_.fetch_add(1, std::memory_order_release);
  epoch_.notify_all();
  while (take_one()) {
  }
  if (spin_until([&] { return done_.load(std::memory_order_acquire) == tasks; })) return;
  for (int done = done_.load(std::memory_order_acquire); done != tasks; done = done_.load(std::memory_order_acquire))
    done_.wait(done, std::memory_order_acquire);
}

}  // namespace booth::fit
