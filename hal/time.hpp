// The one notion of time inside boothd: CLOCK_MONOTONIC nanoseconds, as a type that cannot be mixed up with wall time.
#pragma once

#include <chrono>
#include <cstdint>

namespace booth::hal {

using Nanoseconds = std::chrono::nanoseconds;

/// CLOCK_MONOTONIC. Satisfies the standard's Clock requirements except now(): time comes from a hal::Clock, so that tests and replays can set it.
struct Monotonic {
  using duration = Nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Monotonic>;
  static constexpr bool is_steady = true;
};
using MonotonicTime = Monotonic::time_point;

/// UTC as nanoseconds since 1970-01-01; only for what leaves the process (wire, files).
struct Utc {
  using duration = Nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Utc>;
  static constexpr bool is_steady = false;
};
using UtcTime = Utc::time_point;

constexpr double seconds(Nanoseconds d) { return std::chrono::duration<double>(d).count(); }
constexpr Nanoseconds from_seconds(double s) { return Nanoseconds(static_cast<std::int64_t>(s * 1e9)); }

}  // namespace booth::hal
