// What a verb says with --json: one object on one line.
#pragma once

#include <iostream>
#include <nlohmann/json.hpp>

namespace booth::daemon {

/// To standard output. A path need not be UTF-8, and a verb that has done its work does not fail for that: such bytes become U+FFFD.
inline void print_json(const nlohmann::ordered_json& object) {
  std::cout << object.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n";
}

}  // namespace booth::daemon
