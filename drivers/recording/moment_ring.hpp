// The last moments of the booth in a fixed piece of memory: one writer, any number of readers, the oldest gives way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "hal/time.hpp"

namespace booth::drivers {

struct Moment {
  enum class Kind : std::uint8_t { depth, group, event };
  Kind kind{};
  std::uint8_t camera = 0;
  hal::MonotonicTime time{};
};

/// Thread-safe. Its memory is taken, touched and kept out of core dumps at construction; push() allocates nothing.
class MomentRing {
 public:
  /// Where a reader is.
  struct Cursor {
    std::uint64_t number = 0, position = 0;
  };

  /// Moments older than `keep` before the newest are forgotten, whether there is room or not. Throws std::bad_alloc.
  MomentRing(std::size_t bytes, hal::Nanoseconds keep);
  ~MomentRing();
  MomentRing(const MomentRing&) = delete;

  /// False when the bytes are more than the ring has.
  bool push(const Moment& moment, std::span<const std::byte> bytes);
  /// The oldest that is held, or what comes next.
  Cursor oldest() const;
  Cursor next() const;
  /// Copies the moment at the cursor and moves it on. False when there is none yet. What was overwritten meanwhile is passed over and counted in `missed`.
  bool read(Cursor& cursor, Moment& moment, std::vector<std::byte>& bytes, std::uint64_t& missed) const;

  std::size_t capacity() const { return capacity_; }
  std::size_t held_bytes() const;
  hal::Nanoseconds held_time() const;

 private:
  struct Header;
  Header& header(std::uint64_t position) const;
  void drop_oldest();
  /// Past the gap that is left where a moment did not fit before the end.
  std::uint64_t past_gap(std::uint64_t position) const;

  const std::size_t capacity_;
  const hal::Nanoseconds keep_;
  std::byte* memory_ = nullptr;
  mutable std::mutex mutex_;
  std::uint64_t first_position_ = 0, next_position_ = 0;  ///< they only grow; the place is what remains modulo the capacity
  std::uint64_t first_number_ = 0, next_number_ = 0;
  hal::MonotonicTime newest_{};
};

}  // namespace booth::drivers
