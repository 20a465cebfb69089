// boothctl evaluate: the accuracy study, booth-evaluate of the test tree.
#include <CLI/CLI.hpp>

#include "daemon/ctl/test_program.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {

void add_evaluate_verb(CLI::App& app) {
  CLI::App* verb = app.add_subcommand("evaluate", "The paper's experiments and ours on bodies nobody trained on: errors as tables and pictures");
  verb->prefix_command();
  verb->set_help_flag();  // booth-evaluate knows the options
  verb->callback([verb] { become_test_program("evaluate", "booth-evaluate", verb->remaining()); });
}

}  // namespace booth::daemon
