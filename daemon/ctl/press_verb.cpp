// boothctl press: the button of a simulated panel, pressed from a keyboard.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::json;

struct Options {
  std::string socket, button = "start";
  double seconds = 0.2;
  bool hold = false, let_go = false;
};

void push(ControlClient& client, const std::string& button, bool down) {
  const Json answer = Json::parse(client.ask(Json{{"request", "press"}, {"button", button}, {"down", down}}.dump()), nullptr, false);
  if (!answer.is_object()) throw VerbFailure("boothd gave an answer that is not JSON");
  if (!answer.value("ok", false)) throw VerbFailure(answer.value("error", "refused"));
}

void run(const Options& options) {
  ControlClient client(control_socket_path(options.socket));
  if (!options.let_go) push(client, options.button, true);
  if (!options.let_go && !options.hold) std::this_thread::sleep_for(std::chrono::duration<double>(options.seconds));
  if (!options.hold) push(client, options.button, false);
}

}  // namespace

void add_press_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("press", "Press a button of a simulated panel (gpio.chip = \"simulated\")");
  verb->add_option("button", options->button, "start, stop or emergency_stop")->capture_default_str();
  verb->add_option("--seconds", options->seconds, "How long")->check(CLI::Range(0.0, 3600.0))->capture_default_str();
  CLI::Option* hold = verb->add_flag("--hold", options->hold, "Press and do not let go");
  verb->add_flag("--let-go", options->let_go, "Let go of what is held")->excludes(hold);
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon
