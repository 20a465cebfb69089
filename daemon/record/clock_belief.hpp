// Whether the clock may be believed when it says that something is old enough to be deleted: one that leapt by years would cost every session.
#pragma once

#include <cstdint>
#include <filesystem>

namespace booth::daemon {

/// A leap forward by more than this since the last look is doubted; a booth that was switched off for so long looks the same.
inline constexpr std::int64_t kClockLeapDays = 40;
/// After this, in which the clock went on from where it leapt to, it is believed: whoever cares for the booth had time to put it right.
inline constexpr std::int64_t kClockDoubtDays = 1;

/// Compares `now_utc_ns` with what was last seen, kept in DIRECTORY/.clock, and writes it down anew. Where nothing was seen yet the clock is believed; where
/// nothing can be written, a leap stays doubted. A clock that goes back is believed: it makes nothing older. Never throws.
bool clock_believed(const std::filesystem::path& directory, std::int64_t now_utc_ns);

}  // namespace booth::daemon
