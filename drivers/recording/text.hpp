// Small exact conversions between text and time or numbers that the layouts share; never locale-dependent.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>

#include "hal/time.hpp"

namespace booth::drivers {

/// "1703695509.622443" to nanoseconds without passing through a double; at most nine decimals count.
inline std::optional<hal::UtcTime> parse_seconds(std::string_view text) {
  const auto dot = text.find('.');
  const auto whole = text.substr(0, dot);
  std::int64_t seconds = 0;
  const auto [end, error] = std::from_chars(whole.data(), whole.data() + whole.size(), seconds);
  if (error != std::errc() || end != whole.data() + whole.size() || seconds < 0 || seconds > 9'000'000'000) return std::nullopt;
  std::int64_t nanoseconds = 0, unit = 100'000'000;
  if (dot != std::string_view::npos)
    for (const char c : text.substr(dot + 1)) {
      if (c < '0' || c > '9') return std::nullopt;
      nanoseconds += (c - '0') * unit;
      unit /= 10;
    }
  return hal::UtcTime(std::chrono::seconds(seconds) + hal::Nanoseconds(nanoseconds));
}

inline std::string format_seconds(hal::UtcTime t) {
  const std::int64_t ns = t.time_since_epoch().count();
  char text[40];
  std::snprintf(text, sizeof text, "%lld.%09lld", static_cast<long long>(ns / 1'000'000'000), static_cast<long long>(ns % 1'000'000'000));
  return text;
}

/// A finite number and nothing else.
inline std::optional<double> parse_number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The shortest text that reads back as the same number.
template <typename Number>
std::string format_number(Number value) {
  char text[40];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  return error == std::errc() ? std::string(text, end) : std::string("nan");
}

/// A JSON string, quotes and all; control characters become blanks.
inline std::string json_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + '"';
}

}  // namespace booth::drivers
