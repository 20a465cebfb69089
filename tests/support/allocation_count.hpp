// Counts heap allocations (malloc and everything above it: operator new, Eigen, C libraries), so that a test can say "this path allocates nothing".
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>

namespace booth::tests {

/// Allocations of the whole process since construction. Link booth_allocation_count, which interposes malloc; one object at a time.
class AllocationCount {
 public:
  /// `excused`: shared libraries that are known to allocate for themselves, by the beginning of their file's name ("libpng"): what they ask for is
  /// counted apart. At most eight.
  explicit AllocationCount(std::initializer_list<const char*> excused = {});
  ~AllocationCount();
  AllocationCount(const AllocationCount&) = delete;

  /// All threads, without the excused libraries.
  std::uint64_t so_far() const;
  /// Of the threads that carry frames (their names begin with "frame-"), without the excused libraries; those that read cameras ("frame-cam") apart.
  std::uint64_t on_frame_threads() const;
  std::uint64_t on_camera_threads() const;
  /// By excused libraries, on threads that carry frames.
  std::uint64_t excused_on_frame_threads() const;
  /// Where the first few of on_frame_threads() and on_camera_threads() were asked for: thread and call stack, one line each.
  std::string first_places() const;

  /// False under sanitizers, which bring their own malloc: skip the test there.
  static bool supported();

 private:
  struct Totals {
    std::uint64_t of[3][2] = {};  ///< [kind of thread][excused]
  };
  static Totals totals();
  Totals start_;
};

}  // namespace booth::tests
