// Instants as certificates and permissions have them: seconds of UTC, and their text.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace booth::daemon {

inline constexpr std::int64_t kSecondsOfDay = 86'400;

/// From and until, seconds since 1970 UTC, both inclusive.
struct Validity {
  std::int64_t from = 0, until = 0;
};

/// The system's clock, seconds since 1970.
std::int64_t utc_seconds();

/// "2027-01-31T12:00:00Z", as XML Schema writes a dateTime.
std::string utc_text(std::int64_t seconds);

/// The reverse; the Z may be missing. Nothing where the text is no such instant.
std::optional<std::int64_t> utc_of(const std::string& text);

/// The day alone: "2027-01-31".
std::string utc_day(std::int64_t seconds);

}  // namespace booth::daemon
