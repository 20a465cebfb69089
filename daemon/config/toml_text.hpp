// Values as TOML writes them, for the files that boothd writes itself.
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>

namespace booth::daemon {

/// A basic string; control characters are escaped.
inline std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    else
      out += c;
  }
  return out + "\"";
}

/// A float, which in TOML has a point or an exponent; the shortest that reads back to the same bits.
inline std::string toml_float(double value) {
  std::string text = fmt::format("{}", value);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

}  // namespace booth::daemon
