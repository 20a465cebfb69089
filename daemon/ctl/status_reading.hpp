// Reads the status that boothd answers without trusting it: what is missing or of another kind is empty, false or zero.
#pragma once

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace booth::daemon {

using StatusJson = nlohmann::ordered_json;

inline std::string text_in(const StatusJson& j, const char* key) {
  return j.is_object() && j.contains(key) && j[key].is_string() ? j[key].get<std::string>() : std::string();
}
inline bool flag_in(const StatusJson& j, const char* key) { return j.is_object() && j.contains(key) && j[key].is_boolean() && j[key].get<bool>(); }
/// Whether there is a number of that name; what boothd does not know is null.
inline bool has_number(const StatusJson& j, const char* key) { return j.is_object() && j.contains(key) && j[key].is_number(); }
/// Always finite.
inline double number_in(const StatusJson& j, const char* key) {
  if (!has_number(j, key)) return 0;
  const double value = j[key].get<double>();
  return std::isfinite(value) ? value : 0;
}
/// A counter; 0 for what is negative or too great for one.
inline std::uint64_t count_in(const StatusJson& j, const char* key) {
  const double value = number_in(j, key);
  return value > 0 && value < 1.8e19 ? static_cast<std::uint64_t>(value) : 0;
}
/// The object or list of that name, or an empty one.
inline StatusJson part_of(const StatusJson& j, const char* key) {
  return j.is_object() && j.contains(key) && j[key].is_structured() ? j[key] : StatusJson::object();
}

}  // namespace booth::daemon
