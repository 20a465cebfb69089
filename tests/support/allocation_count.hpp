// Counts heap allocations (malloc and everything above it), so that a test can say "this path allocates nothing".
#pragma once

#include <cstdint>

namespace booth::tests {

/// Allocations of the whole process, all threads, since construction. Link booth_allocation_count, which interposes malloc.
class AllocationCount {
 public:
  AllocationCount();
  std::uint64_t so_far() const;
  /// False under sanitizers, which bring their own malloc: skip the test there.
  static bool supported();

 private:
  std::uint64_t start_;
};

}  // namespace booth::tests
