// `boothctl fit`: one person's body and pose from point clouds or meshes.
#pragma once

namespace CLI {
class App;
}

namespace booth::daemon {

/// Registers the verb. When it is given, parsing runs it; it throws std::runtime_error with one sentence when it fails.
void add_fit_verb(CLI::App& boothctl);

}  // namespace booth::daemon
