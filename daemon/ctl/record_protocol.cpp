// JSON in, JSON out.
#include "daemon/ctl/record_protocol.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

/// boothctl asks every half second; one that died does not ask any more.
constexpr hal::Nanoseconds kPatience = std::chrono::seconds(15);

std::string dump(const Json& j) { return j.dump(-1, ' ', false, Json::error_handler_t::replace); }
std::string refusal(const std::string& text) { return dump({{"ok", false}, {"error", text}}); }

Json recording_json(const hal::RecordingStatus& r) {
  return {{"path", r.path},     {"running", r.running}, {"depth", r.depth}, {"seconds", std::round(r.seconds * 100) / 100},
          {"frames", r.frames}, {"missed", r.missed},   {"bytes", r.bytes}, {"problem", r.problem}};
}

Json recorder_json(const hal::RecorderStatus& s) {
  return {{"depth_allowed", s.depth_allowed},
          {"seconds_held", std::round(s.seconds_held * 10) / 10},
          {"bytes_held", s.bytes_held},
          {"bytes_capacity", s.bytes_capacity},
          {"dropped", s.dropped},
          {"recording", recording_json(s.recording)},
          {"snapshot", recording_json(s.snapshot)}};
}

std::string recorder_answer(hal::FlightRecorder& recorder) {
  Json j{{"ok", true}};
  j.update(recorder_json(recorder.status(true)));
  return dump(j);
}

bool flag(const Json& request, const char* key) { return request.contains(key) && request[key].is_boolean() && request[key].get<bool>(); }

std::string begin_recording(const Json& request, hal::FlightRecorder& recorder) {
  double seconds = kLongestRecording;
  if (request.contains("seconds")) {
    if (!request["seconds"].is_number()) return refusal("\"seconds\" must be a number");
    seconds = request["seconds"].get<double>();
  }
  if (!(seconds > 0 && seconds <= kLongestRecording)) return refusal(fmt::format("\"seconds\" must be above 0 and at most {:.0f}", kLongestRecording));
  const std::string why_not = recorder.record(flag(request, "depth"), flag(request, "uncompressed"), seconds, kPatience);
  return why_not.empty() ? recorder_answer(recorder) : refusal(why_not);
}

}  // namespace

SnapshotAnswer request_snapshot(hal::FlightRecorder& recorder, const std::string& reason) {
  const std::string why_not = recorder.snapshot(reason);
  return why_not.empty() ? SnapshotAnswer{true, recorder.status(false).snapshot.path} : SnapshotAnswer{false, why_not};
}

std::optional<std::string> answer_record_request(const std::string& line, hal::FlightRecorder& recorder) {
  const Json request = Json::parse(line, nullptr, false);
  if (!request.is_object() || !request.contains("request") || !request["request"].is_string()) return std::nullopt;
  const std::string what = request["request"].get<std::string>();
  if (what == "record") return begin_recording(request, recorder);
  if (what == "record_status") return recorder_answer(recorder);
  if (what == "record_stop") {
    recorder.stop();
    return recorder_answer(recorder);
  }
  if (what == "snapshot") {
    const SnapshotAnswer answer = request_snapshot(recorder, "asked for");
    return answer.accepted ? recorder_answer(recorder) : refusal(answer.text);
  }
  return std::nullopt;
}

std::string with_recorder(std::string answer, hal::FlightRecorder& recorder) {
  if (answer.find("\"cameras_minimum\"") == std::string::npos) return answer;
  Json j = Json::parse(answer, nullptr, false);
  if (!j.is_object()) return answer;
  j["recorder"] = recorder_json(recorder.status(false));
  return dump(j);
}

}  // namespace booth::daemon
