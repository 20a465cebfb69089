// On gmtime and timegm, which know no zones.
#include "daemon/security/utc_time.hpp"

#include <time.h>

#include <cstring>

namespace booth::daemon {
namespace {

std::string format(std::int64_t seconds, const char* how) {
  const time_t t = seconds;
  tm parts{};
  char text[64];
  if (::gmtime_r(&t, &parts) == nullptr || ::strftime(text, sizeof text, how, &parts) == 0) return "?";
  return text;
}

}  // namespace

std::int64_t utc_seconds() { return static_cast<std::int64_t>(::time(nullptr)); }

std::string utc_text(std::int64_t seconds) { return format(seconds, "%Y-%m-%dT%H:%M:%SZ"); }

std::string utc_day(std::int64_t seconds) { return format(seconds, "%Y-%m-%d"); }

std::optional<std::int64_t> utc_of(const std::string& text) {
  tm parts{};
  const char* rest = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &parts);
  if (rest == nullptr || (*rest != '\0' && std::strcmp(rest, "Z") != 0)) return std::nullopt;
  return static_cast<std::int64_t>(::timegm(&parts));
}

}  // namespace booth::daemon
