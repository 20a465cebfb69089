// The one way in which the drivers have TOML parsed: nothing reaches the library that it is not made for.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#ifndef TOML_ENABLE_FORMATTERS
#define TOML_ENABLE_FORMATTERS 0
#endif
#include <toml++/toml.h>

#include "hal/toml_shape.hpp"

namespace booth::drivers {

/// As toml::parse(); a text whose shape is not TOML's (hal/toml_shape.hpp) is refused before. Throws toml::parse_error. Thread-safe.
inline toml::table parse_toml(std::string_view text, const std::string& name = {}) {
  if (const auto fault = hal::find_toml_fault(text))
    throw toml::parse_error(fault->what.c_str(), {static_cast<toml::source_index>(fault->line), static_cast<toml::source_index>(fault->column)},
                            std::make_shared<const std::string>(name));
  return toml::parse(text, std::string_view(name));
}

}  // namespace booth::drivers
