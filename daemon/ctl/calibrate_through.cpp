// Ask, look five times a second, say what is new.
#include "daemon/ctl/calibrate_through.hpp"

#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::json;

std::atomic<bool> interrupted{false};

Json ask(ControlClient& client, const char* request) {
  Json answer = Json::parse(client.ask(Json{{"request", request}}.dump()), nullptr, false);
  if (!answer.is_object()) throw VerbFailure("boothd gave an answer that is not JSON");
  return answer;
}

std::string line_of(const Json& c) {
  const std::string seen = c.value("seen", ""), next = c.value("next", "");
  return fmt::format("{} views; {}{}{}", c.value("views", 0), c.value("cue", "?"), seen.empty() ? "" : " (" + seen + ")", next.empty() ? "" : "; " + next);
}

std::optional<ControlClient> connect(const std::string& socket) {
  try {
    return std::optional<ControlClient>(std::in_place, control_socket_path(socket));
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

Json follow(ControlClient& client) {
  std::string said;
  bool stopped = false;
  while (true) {
    Json calibration = ask(client, "status").value("calibration", Json::object());
    if (!calibration.value("running", false)) return calibration;
    if (const std::string line = line_of(calibration); line != said) std::cerr << (said = line) << "\n";
    if (interrupted && !stopped) {
      (void)ask(client, "stop");
      stopped = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

}  // namespace

bool calibrate_through_boothd(const std::string& socket, bool json) {
  auto client = connect(socket);
  if (!client) return false;
  const Json answer = ask(*client, "calibrate");
  if (!answer.value("ok", false)) throw VerbFailure(answer.value("error", "boothd refuses"));
  std::signal(SIGINT, [](int) { interrupted = true; });
  const Json ended = follow(*client);
  const std::string outcome = ended.value("outcome", "?"), sentence = ended.value("sentence", "");
  if (json) std::cout << ended.dump(2, ' ', false, Json::error_handler_t::replace) << "\n" << std::flush;
  if (outcome != "stored") throw VerbFailure(fmt::format("{}: {}", outcome, sentence));
  if (!json) std::cout << sentence << "\n" << std::flush;
  return true;
}

}  // namespace booth::daemon
