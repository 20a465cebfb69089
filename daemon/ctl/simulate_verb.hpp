// boothctl simulate: a recording from simulated cameras, with the truth beside it.
#pragma once

namespace CLI {
class App;
}

namespace booth::daemon {

/// The callback throws std::runtime_error or std::invalid_argument naming the option or file.
void add_simulate_verb(CLI::App& app);

}  // namespace booth::daemon
