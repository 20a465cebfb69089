// The newest value from one thread to another, of which neither ever waits for the other.
#pragma once

#include <array>
#include <atomic>

namespace booth::daemon {

/// Three places: one that is written, one that is read, one in between. One thread calls draft() and submit(), another one take(). Allocates what T does.
template <class T>
class LatestValue {
 public:
  /// The writer's place: holds whatever was in it.
  T& draft() { return places_[static_cast<std::size_t>(back_)]; }
  /// Hands the draft over. False when the reader had not taken the one before, which is lost.
  bool submit() {
    const int old = between_.exchange(back_ | kFresh, std::memory_order_acq_rel);
    back_ = old & kPlace;
    return (old & kFresh) == 0;
  }
  /// The newest value that was handed over, valid until the next call; nullptr when there is no newer one than the last.
  const T* take() {
    if ((between_.load(std::memory_order_relaxed) & kFresh) == 0) return nullptr;
    front_ = between_.exchange(front_, std::memory_order_acq_rel) & kPlace;
    return &places_[static_cast<std::size_t>(front_)];
  }

 private:
  static constexpr int kFresh = 4, kPlace = 3;
  std::array<T, 3> places_{};
  std::atomic<int> between_{1};
  int back_ = 0, front_ = 2;
};

}  // namespace booth::daemon
