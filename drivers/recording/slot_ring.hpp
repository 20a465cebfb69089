// A bounded queue between two threads whose values stay where they are: the writer fills the next slot in place, the reader empties the oldest.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace booth::drivers {

/// One thread writes, one reads; neither waits for the other, and nothing is allocated.
template <class T, std::size_t Slots>
class SlotRing {
 public:
  /// The slot to be filled, nullptr when all are full; written() hands it over.
  T* to_write() { return tail_.load(std::memory_order_relaxed) - head_.load(std::memory_order_acquire) == Slots ? nullptr : &slots_[tail_ % Slots]; }
  void written() { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }
  /// The oldest filled slot, nullptr when there is none; done() gives it back.
  T* to_read() { return head_.load(std::memory_order_relaxed) == tail_.load(std::memory_order_acquire) ? nullptr : &slots_[head_ % Slots]; }
  void done() { head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

  /// How many were ever handed over, and given back; for any thread.
  std::size_t handed_over() const { return tail_.load(std::memory_order_acquire); }
  std::size_t given_back() const { return head_.load(std::memory_order_acquire); }

  std::array<T, Slots>& slots() { return slots_; }

 private:
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
  alignas(64) std::array<T, Slots> slots_{};
};

}  // namespace booth::drivers
