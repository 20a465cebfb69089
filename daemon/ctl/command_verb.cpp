// boothctl command: the button of a booth on the network, over DDS.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/ctl/network_options.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/dds/booth_listener.hpp"
#include "daemon/dds/command_client.hpp"

namespace booth::daemon {
namespace {

struct Options {
  std::string booth, command;
  NetworkOptions network;
  double seconds = 10;
  bool json = false;
};

const std::map<std::string, DdsCommand> kCommands{
    {"start", DdsCommand::start}, {"stop", DdsCommand::stop}, {"calibrate", DdsCommand::calibrate}, {"snapshot", DdsCommand::snapshot}};

void run(const Options& options) {
  if (options.booth == "*") throw VerbFailure("a command is for one booth, named by its booth.id", 64);
  CommandClient client(network_settings(options.network, options.booth, Role::console));
  const CommandAnswer answer = client.send(kCommands.at(options.command), std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * options.seconds)));
  if (options.json) {
    std::cout << nlohmann::ordered_json{{"booth", options.booth},
                                        {"accepted", answer.accepted},
                                        {"state", session_state_name(answer.state)},
                                        {"text", answer.text}}
                     .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace)
              << std::endl;
  } else if (answer.accepted) {
    std::cout << fmt::format("{}: {}{}{}\n", options.booth, session_state_name(answer.state), answer.text.empty() ? "" : ", ", answer.text) << std::flush;
  }
  if (!answer.accepted) throw VerbFailure(fmt::format("booth {} refuses: {}", options.booth, answer.text));
}

}  // namespace

void add_command_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("command", "Command a booth on the network over DDS; start and stop do what its button does");
  verb->add_option("booth", options->booth, "The booth.id")->required();
  verb->add_option("command", options->command, "start, stop, calibrate or snapshot")
      ->required()
      ->check(CLI::IsMember({"start", "stop", "calibrate", "snapshot"}));
  add_network_options(*verb, options->network);
  verb->add_option("--seconds", options->seconds, "How long to wait for the answer")->check(CLI::Range(0.1, 600.0))->capture_default_str();
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
