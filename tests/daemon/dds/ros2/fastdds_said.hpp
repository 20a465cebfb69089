// What booth-fastdds-reader has found and heard, from its lines.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

namespace booth::tests {

inline constexpr const char* kNoFastDds = "skipped: libfastrtps-dev, fastddsgen and a Java runtime were not there when this was configured";
inline bool fastdds_is_there() { return std::filesystem::exists(BOOTH_BINARY_DIR "/bin/booth-fastdds-reader"); }

/// What the other vendor's program has said so far.
struct Said {
  std::map<std::string, nlohmann::json> writers, samples;  ///< by topic; the last of each
  std::map<std::string, int> matched;
};
inline Said read_lines(const std::string& text) {
  Said out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const auto j = nlohmann::json::parse(line, nullptr, false);
    if (j.is_discarded()) continue;  // the last line may not be whole yet
    if (j.contains("writer")) out.writers[j.at("writer")] = j;
    if (j.contains("matched")) ++out.matched[j.at("matched")];
    if (j.contains("sample")) out.samples[j.at("topic")] = j.at("sample");
  }
  return out;
}

}  // namespace booth::tests
