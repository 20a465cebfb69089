// --seed, alike for every verb that makes something of random numbers.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <string>

namespace booth::daemon {

/// The range of the configuration's fit.seed: what a reader of JSON that has only doubles still holds exactly. A sign would wrap round unseen otherwise.
template <typename Integer>
CLI::Option* add_seed_option(CLI::App& verb, Integer& seed, const std::string& what) {
  constexpr unsigned long long kMost = 9'000'000'000'000'000;
  static_assert(sizeof(Integer) == sizeof kMost);
  const CLI::Validator in_range(
      [](const std::string& text) -> std::string {
        unsigned long long value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (error == std::errc() && end == text.data() + text.size() && value <= kMost) return {};
        return "'" + text + "' is not a whole number from 0 to " + std::to_string(kMost);
      },
      "0..9e15");
  return verb.add_option("--seed", seed, what)->check(in_range)->capture_default_str();
}

}  // namespace booth::daemon
