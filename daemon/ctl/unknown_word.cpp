// CLI11 only misses a subcommand there, and keeps the word to itself.
#include "daemon/ctl/unknown_word.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "daemon/config/near_word.hpp"

namespace booth::daemon {

std::string unknown_word(const CLI::App& app) {
  const CLI::App* place = &app;
  std::string typed = app.get_name();
  while (!place->get_subcommands().empty()) {
    place = place->get_subcommands().back();
    typed += " " + place->get_name();
  }
  const auto words = place->remaining();
  if (place->get_require_subcommand_min() == 0 || words.empty()) return {};
  const std::string& word = words.front();
  if (word.starts_with("-")) return fmt::format("{} has no option {}", typed, word);
  std::string near;
  std::size_t nearest = misspelling_limit(word) + 1;
  for (const CLI::App* verb : place->get_subcommands([](const CLI::App*) { return true; })) {
    if (const std::size_t d = edit_distance(word, verb->get_name()); d < nearest) {
      nearest = d;
      near = verb->get_name();
    }
  }
  return fmt::format("{}: there is no verb {}{}", typed, word, near.empty() ? "" : fmt::format("; did you mean {}?", near));
}

}  // namespace booth::daemon
