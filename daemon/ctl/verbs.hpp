// The verbs of boothctl. Each registers itself with its options; its callback throws, and main() turns what it throws into a sentence and a status.
#pragma once

#include <stdexcept>
#include <string>

namespace CLI {
class App;
}

namespace booth::daemon {

/// Ends boothctl with this status after the text was printed to stderr.
struct VerbFailure : std::runtime_error {
  explicit VerbFailure(const std::string& text, int s = 1) : std::runtime_error(text), status(s) {}
  int status;
};

void add_status_verb(CLI::App& app);       ///< status
void add_doctor_verb(CLI::App& app);       ///< doctor
void add_start_stop_verbs(CLI::App& app);  ///< start, stop
void add_press_verb(CLI::App& app);        ///< press
void add_watch_verb(CLI::App& app);        ///< watch
void add_fleet_verb(CLI::App& app);        ///< fleet
void add_track_verb(CLI::App& app);        ///< track
void add_bench_verb(CLI::App& app);        ///< bench signature
void add_evaluate_verb(CLI::App& app);     ///< evaluate
void add_export_verbs(CLI::App& app);      ///< export
void add_decrypt_verbs(CLI::App& app);     ///< decrypt, key
void add_record_verbs(CLI::App& app);      ///< record, snapshot
void add_command_verb(CLI::App& app);      ///< command
void add_security_verb(CLI::App& app);     ///< security init, issue, revoke, show
void add_calibrate_verb(CLI::App& app);    ///< calibrate
void add_config_verb(CLI::App& app);       ///< config reference, export, import, reset

}  // namespace booth::daemon
