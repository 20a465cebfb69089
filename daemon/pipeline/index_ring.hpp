// A bounded single-producer single-consumer queue of small values: how buffers change owners between two threads.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace booth::daemon {

/// push() by one thread, pop() by one other; both return at once and never allocate. Holds up to `Capacity` values (a power of two).
template <class T, std::size_t Capacity>
class IndexRing {
  static_assert((Capacity & (Capacity - 1)) == 0, "the capacity must be a power of two");

 public:
  /// False when full; the value is then still the caller's.
  bool push(const T& value) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_.load(std::memory_order_acquire) == Capacity) return false;
    items_[tail & (Capacity - 1)] = value;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// False when empty.
  bool pop(T& value) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    value = items_[head & (Capacity - 1)];
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

 private:
  // On lines of their own: the two threads would otherwise invalidate each other's cache on every call.
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
  alignas(64) std::array<T, Capacity> items_{};
};

}  // namespace booth::daemon
