// What to say where a word stands in the place of a verb and is none.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace booth::daemon {

/// After `app` failed to parse: the sentence that names the word and the verb that was probably meant. Empty where something else is wrong.
std::string unknown_word(const CLI::App& app);

}  // namespace booth::daemon
