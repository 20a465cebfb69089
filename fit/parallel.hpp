// A fixed set of threads that share one loop's iterations, so that a frame uses all cores without starting a thread or allocating.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace booth::fit {

template <typename Signature>
class FunctionRef;

/// A callable that somebody else keeps alive: two pointers, no allocation.
template <typename R, typename... Args>
class FunctionRef<R(Args...)> {
 public:
  template <typename F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, FunctionRef> && std::is_invocable_r_v<R, F&, Args...>) FunctionRef(F&& f)
  noexcept  // NOLINT(google-explicit-constructor): a lambda is passed where a FunctionRef is asked for
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(f)))),
        call_([](void* object, Args... args) -> R { return (*static_cast<std::remove_reference_t<F>*>(object))(std::forward<Args>(args)...); }) {}
  R operator()(Args... args) const { return call_(object_, std::forward<Args>(args)...); }

 private:
  void* object_;
  R (*call_)(void*, Args...);
};

/// Half-open range of items.
struct Range {
  int begin, end;
};

/// The `block`-th of `blocks` nearly equal parts of [0, items). Depends on nothing else, so results can be the same for any number of threads.
constexpr Range block_range(int items, int blocks, int block) {
  return {static_cast<int>(static_cast<std::int64_t>(items) * block / blocks), static_cast<int>(static_cast<std::int64_t>(items) * (block + 1) / blocks)};
}

/// Runs numbered tasks on a fixed number of threads, of which the caller is one. run() allocates nothing and wakes sleeping workers only when
/// there is more than one task. Which thread takes which task is open: for reproducible results a task may write only what no other task of the
/// same run reads or writes, and sums are to be joined in the order of the tasks afterwards.
class WorkerPool {
 public:
  /// Starts threads - 1 workers. Throws std::invalid_argument unless 1 <= threads <= 256, std::system_error when the system refuses a thread.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  /// Calls body(0) ... body(tasks - 1), each once, and returns when all have returned; what they wrote is visible to the caller.
  /// `body` must not throw and must not call run() of the same pool. One thread calls run() at a time.
  void run(int tasks, FunctionRef<void(int)> body);

 private:
  bool take_one();
  void work();

  // A ticket is (run number << 32 | tasks not yet taken). Taking one is a compare-exchange on the whole, so a worker that wakes late can never
  // take a task of a run that it did not see; once it has taken one, run() cannot return, and body_ and tasks_ stay what they are.
  std::atomic<std::uint64_t> ticket_{0};
  std::atomic<int> epoch_{0};  // counts runs; what sleeping workers wait on
  std::atomic<int> done_{0};
  std::atomic<bool> stop_{false};
  const FunctionRef<void(int)>* body_ = nullptr;
  int tasks_ = 0;
  std::uint32_t run_ = 0;
  std::vector<std::thread> workers_;
};

}  // namespace booth::fit
