// What was so at the last look is kept here, thing by thing, and compared.
#include "daemon/session/booth_news.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "daemon/health/log.hpp"
#include "daemon/health/messages.hpp"
#include "daemon/session/drift_words.hpp"

namespace booth::daemon {

namespace {

/// Of what works where more than one thing can. Said when the work changes hands, and at the start; a device that is tried again and again in vain is no news.
template <class Status>
bool is_news(const Status& said, const Status& now) {
  return now.changes != said.changes || (said.name != now.name && !now.problem.empty());
}
constexpr hal::Nanoseconds kRepetitions = std::chrono::minutes(10);
void write_camera_line(LogLevel level, const std::string& text) {
  log_message(level, level == LogLevel::warning ? Message::camera_lost : Message::camera_changed, text);
}
void write_panel_line(LogLevel level, const std::string& text) { log_message(level, Message::panel_problem, text); }
const char* kind_of(bool bad) { return bad ? "fault" : "state"; }
LogLevel level_of(bool bad) { return bad ? LogLevel::warning : LogLevel::info; }

}  // namespace

BoothNews::BoothNews(hal::Clock& clock, Say say)
    : clock_(clock), say_(std::move(say)), camera_log_(kRepetitions, write_camera_line), panel_log_(kRepetitions, write_panel_line) {}

void BoothNews::cameras(const std::vector<CameraStatus>& now) {
  camera_states_.resize(now.size(), CameraState::starting);
  camera_problems_.resize(now.size());
  for (std::size_t i = 0; i < now.size(); ++i) {
    const bool lost = now[i].state == CameraState::lost;
    if (now[i].state == camera_states_[i]) {
      // Still lost, but perhaps for another reason than before.
      if (lost && !now[i].problem.empty() && now[i].problem != camera_problems_[i])
        camera_log_.say(LogLevel::warning, fmt::format("camera {}: {}", now[i].name, camera_problems_[i] = now[i].problem), clock_.now());
      continue;
    }
    camera_states_[i] = now[i].state, camera_problems_[i] = now[i].problem;
    const std::string text = fmt::format("camera {} is {}{}{}", now[i].name, to_string(now[i].state), now[i].problem.empty() ? "" : ": ", now[i].problem);
    camera_log_.say(level_of(lost), text, clock_.now());
    say_(kind_of(lost), "cameras", text);
  }
  camera_log_.tell(clock_.now());
  decoders(now);
}

void BoothNews::decoders(const std::vector<CameraStatus>& now) {
  decoders_.resize(now.size());
  for (std::size_t i = 0; i < now.size(); ++i) {
    const hal::DecodeStatus& one = now[i].decoding;
    if (is_news(decoders_[i], one)) changed_hands(fmt::format("depth of camera {} is decoded", now[i].name), "cameras", one.name, one.problem);
    decoders_[i] = one;
  }
}

void BoothNews::backend(const BackendStatus& now) {
  if (is_news(backend_, now)) changed_hands("the fit is computed", "fit", now.name, now.problem);
  backend_ = now;
}

void BoothNews::changed_hands(const std::string& what, const std::string& source, const std::string& name, const std::string& problem) {
  const bool bad = !problem.empty();
  const std::string text = fmt::format("{} by {}{}{}", what, name, bad ? ": " : "", problem);
  log_message(level_of(bad), Message::backend_changed, text);
  say_(kind_of(bad), source, text);
}

std::optional<std::string> BoothNews::drift(const std::vector<CameraDriftStatus>& now, const std::vector<CameraStatus>& cameras) {
  drift_.resize(now.size(), CameraDriftStatus::Verdict::unknown);
  std::string problem;
  bool changed = false;
  for (std::size_t c = 0; c < now.size() && c < cameras.size(); ++c) {
    const bool bad = off_its_place(now[c]), was_bad = off_its_place(drift_[c]);
    const std::string text = drift_sentence(cameras[c].name, now[c]);
    if (bad && problem.empty()) problem = text;
    changed |= bad != was_bad || (bad && now[c].verdict != drift_[c]);
    if (now[c].verdict != drift_[c] && (bad || was_bad)) {
      log_message(level_of(bad), Message::camera_moved, text);
      say_(kind_of(bad), "cameras", text);
    }
    drift_[c] = now[c].verdict;
  }
  return changed ? std::optional(problem) : std::nullopt;
}

void BoothNews::panel(const std::vector<std::string>& problems) {
  for (const auto& problem : problems)
    if (std::find(panel_problems_.begin(), panel_problems_.end(), problem) == panel_problems_.end() &&
        panel_log_.say(LogLevel::warning, "panel: " + problem, clock_.now()))
      say_("fault", "gpio", problem);
  if (problems.empty() && !panel_problems_.empty() && panel_log_.say(LogLevel::info, "panel: buttons and light work again", clock_.now()))
    say_("state", "gpio", "buttons and light work again");
  panel_log_.tell(clock_.now());
  panel_problems_ = problems;
}

void BoothNews::credentials(const std::string& problem) {
  if (problem == credentials_) return;
  credentials_ = problem;
  const bool bad = !problem.empty();
  if (bad) log_message(LogLevel::warning, Message::credentials_expire, problem);
  say_(kind_of(bad), "dds", bad ? problem : "the credentials serve for long enough again");
}

}  // namespace booth::daemon
