// boothctl: the one command a person types.
#include <CLI/CLI.hpp>
#include <csignal>
#include <iostream>

#include "daemon/ctl/care_verbs.hpp"
#include "daemon/ctl/fit_verb.hpp"
#include "daemon/ctl/model_verb.hpp"
#include "daemon/ctl/simulate_verb.hpp"
#include "daemon/ctl/unknown_word.hpp"
#include "daemon/ctl/verbs.hpp"

int main(int argc, char** argv) {  // NOLINT(bugprone-exception-escape): a complaint that cannot be put on the console is all that is left to throw
  using namespace booth::daemon;
  constexpr int kUsage = 64;
  CLI::App app{"Talks to boothd, and does by itself what needs no daemon.", "boothctl"};
  app.set_version_flag("--version", "boothctl " BOOTHD_VERSION);
  app.require_subcommand(1);
  add_status_verb(app);
  add_start_stop_verbs(app);
  add_press_verb(app);
  add_doctor_verb(app);
  add_watch_verb(app);
  add_fleet_verb(app);
  add_track_verb(app);
  add_record_verbs(app);
  add_export_verbs(app);
  add_decrypt_verbs(app);
  add_fit_verb(app);
  add_simulate_verb(app);
  add_model_verbs(app);
  add_bench_verb(app);
  add_evaluate_verb(app);
  add_command_verb(app);
  add_security_verb(app);
  add_calibrate_verb(app);
  add_config_verb(app);
  add_health_verb(app);
  add_metrics_verb(app);
  add_report_verb(app);
  std::signal(SIGPIPE, SIG_IGN);
  try {
    app.parse(argc, argv);
    // Half an export is worse than none, and its reader cannot tell: a full disk or a closed pipe is a failure.
    if (!std::cout.flush()) throw VerbFailure("what it has to say could not be written: the disk is full, or nobody reads it any more");
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    const std::string unknown = unknown_word(app);
    app.exit(unknown.empty() ? e : CLI::ParseError(unknown, CLI::ExitCodes::ExtrasError));
    return kUsage;
  } catch (const VerbFailure& e) {
    std::cerr << "boothctl: " << e.what() << "\n";
    return e.status;
  } catch (const std::exception& e) {
    std::cerr << "boothctl: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
