// The one table of configuration keys: parsing, --check-config and the reference page are all made from it.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "daemon/config/config.hpp"

namespace booth::daemon {

/// Where a key's value lives in a Config; the alternative is the key's type.
using ConfigSlot = std::variant<bool*, std::int64_t*, double*, std::string*, std::vector<std::string>*>;

struct ConfigKey {
  std::string_view name;  ///< dotted, as in TOML
  ConfigSlot (*slot)(Config&);
  std::string_view doc;                                                                                          ///< one sentence
  double minimum = -std::numeric_limits<double>::infinity(), maximum = std::numeric_limits<double>::infinity();  ///< of numbers
  std::vector<std::string_view> choices{};                                                                       ///< of text; empty: any
  /// Values that the format knows but this build cannot do; they are refused as such.
  std::vector<std::string_view> absent{};
  /// Returns what is wrong with a text, empty when nothing is.
  std::string (*check)(std::string_view) = nullptr;
};

/// In the order of the reference page. Constant.
std::span<const ConfigKey> config_keys();

/// nullptr when there is none.
const ConfigKey* find_config_key(std::string_view name);

/// The key or table name nearest to a misspelt one by edit distance; empty when none is near.
std::string_view nearest_config_key(std::string_view name);

/// "a number from 0.5 to 5", "one of \"booth\", \"paper\"" ...
std::string allowed_values(const ConfigKey& key);

/// The value as TOML.
std::string format_config_value(const ConfigKey& key, const Config& config);

}  // namespace booth::daemon
