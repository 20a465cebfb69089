// Two requests, each checked before anything is touched.
#include "daemon/ctl/panel_protocol.hpp"

#include <nlohmann/json.hpp>

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

std::string dump(const Json& j) { return j.dump(-1, ' ', false, Json::error_handler_t::replace); }
std::string error(const std::string& text) { return dump({{"ok", false}, {"error", text}}); }

std::string text_of(const Json& j, const char* key) { return j.contains(key) && j[key].is_string() ? j[key].get<std::string>() : ""; }

std::string press(const Json& request, SimulatedVisitor& visitor) {
  if (!request.contains("down") || !request["down"].is_boolean()) return error("press needs \"down\": true or false");
  if (!visitor.press(text_of(request, "button"), request["down"].get<bool>()))
    return error("the panel has no button of this name; there are start, stop and emergency_stop where gpio.* names their lines");
  return dump({{"ok", true}});
}

std::string lamp(const Json& request, const SimulatedVisitor& visitor) {
  const std::string name = text_of(request, "lamp");
  if (name != "light" && name != "buzzer") return error("lamp needs \"lamp\": \"light\" or \"buzzer\"");
  Json j{{"ok", true}, {"lit", visitor.lit(name)}, {"changes", Json::array()}};
  for (const auto& change : visitor.history(name)) j["changes"].push_back({change.at.time_since_epoch().count(), change.on});
  return dump(j);
}

}  // namespace

std::optional<std::string> answer_panel_request(const std::string& line, SimulatedVisitor* visitor) {
  const Json request = Json::parse(line, nullptr, false);
  if (!request.is_object()) return std::nullopt;
  const std::string what = text_of(request, "request");
  if (what != "press" && what != "lamp") return std::nullopt;
  if (visitor == nullptr) return error("the panel of this booth is not a simulated one: gpio.chip is not \"simulated\"");
  return what == "press" ? press(request, *visitor) : lamp(request, *visitor);
}

}  // namespace booth::daemon
