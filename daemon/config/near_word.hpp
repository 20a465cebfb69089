// Which word a person meant: for keys and verbs that were misspelt.
#pragma once

#include <cstddef>
#include <string_view>

namespace booth::daemon {

/// How many letters have to be put in, taken out or changed to get from one to the other (Levenshtein).
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The most of them that a misspelling of `word` still has; beyond, guesses annoy.
std::size_t misspelling_limit(std::string_view word);

}  // namespace booth::daemon
