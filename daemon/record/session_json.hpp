// session.json as text that may be anything: a file that rotted, or somebody else's.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace booth::daemon {

/// Bytes of a session.json that anybody may ask for.
inline constexpr std::uint64_t kMostSessionJson = 64u << 20;
/// No file of ours nests deeper; what does would overflow the stack of whoever copies it.
inline constexpr int kMostSessionNesting = 64;

/// Discarded where the text is no JSON. What lies deeper than kMostSessionNesting is left out.
inline nlohmann::ordered_json parse_session_json(const std::string& text) {
  using Json = nlohmann::ordered_json;
  return Json::parse(
      text, [](int depth, Json::parse_event_t, Json&) { return depth < kMostSessionNesting; }, false);
}

}  // namespace booth::daemon
