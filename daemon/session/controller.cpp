// The controller's thread: requests, frames, time and cameras in; session files, DDS samples and log lines out.
#include "daemon/session/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "daemon/health/log.hpp"
#include "daemon/health/messages.hpp"
#include "daemon/pipeline/coverage.hpp"
#include "daemon/session/dds_samples.hpp"

namespace booth::daemon {

using namespace std::chrono_literals;

Controller::Controller(ControllerSettings settings, hal::Clock& clock)
    : settings_(std::move(settings)),
      clock_(clock),
      machine_(settings_.limits),
      news_(clock, [this](const std::string& kind, const std::string& source, const std::string& text) { say_event(kind, source, text); }) {}

Controller::~Controller() { shutdown("end"); }

void Controller::run(Pipeline& pipeline, FrameFitter& fitter, DdsLink* dds) {
  pipeline_ = &pipeline;
  fitter_ = &fitter;
  dds_ = dds;
  for (const auto& line : close_interrupted_sessions(settings_.session_directory, settings_.models)) log_line(LogLevel::warning, line);
  thread_ = std::thread([this] { loop(); });
}

ControlAnswer Controller::request(SessionEvent event, const std::string& source) {
  std::future<ControlAnswer> answer;
  {
    const std::lock_guard lock(queue_mutex_);
    if (ending_ && (stop_ || event != SessionEvent::stop)) return {false, state(), "boothd is ending"};
    if (queue_.size() >= kQueue) return {false, state(), "too many requests at once"};
    queue_.push_back({event, source, {}});
    answer = queue_.back().answer.get_future();
  }
  bell_.ring();
  return answer.get();
}

void Controller::shutdown(const std::string& reason) {
  if (!thread_.joinable()) return;
  {
    // First of all: whoever asks for a session again and again (on DDS) could otherwise begin one after another before idle was seen here.
    const std::lock_guard lock(queue_mutex_);
    ending_ = true;
  }
  request(SessionEvent::stop, reason);
  while (state() != SessionState::idle) std::this_thread::sleep_for(5ms);
  {
    const std::lock_guard lock(queue_mutex_);
    stop_ = true;
  }
  bell_.ring();
  thread_.join();
  for (auto& left : queue_) left.answer.set_value({false, state(), "boothd is ending"});
  queue_.clear();
  if (finisher_.joinable()) finisher_.join();
}

void Controller::publish(FrameRecord& record) noexcept {
  record.session_state = wire_state(state());
  if (dds_) dds_->publish(record);
}

void Controller::log(const FrameRecord& record) noexcept {
  log_.append(record);
  (void)notes_.push({record.person != PersonState::lost, record.body_accepted != 0});
  {
    const std::lock_guard lock(shared_mutex_);
    last_ = record;
    last_known_ = true;
    if (bodies_.another(record)) {
      accepted_ = record;
      body_due_ = true;
    }
    last_frame_ = clock_.now();
    if (frames_++ == 0) first_frame_ = last_frame_;
    remark_ = fitter_->remark();
  }
  bell_.ring();
}

void Controller::loop() {
  while (!stop_) {
    bell_.wait(10ms);
    progress_.turn();
    take_requests();
    take_frames();
    watch_cameras();
    watch_rest();
    watch_disk();
    watch_calibration();
    watch_log();
    const hal::MonotonicTime now = clock_.now();
    if (files_done_.exchange(false)) {
      finisher_.join();
      apply(machine_.handle(SessionEvent::files_written, now), "session");
    }
    apply(machine_.tick(now, paused_), "time");
    const bool silent = !machine_.running() || paused_;
    if (dds_ && silent && now - last_idle_ >= 50ms) {
      dds_->publish_idle(wire_state(machine_.state()));
      last_idle_ = now;
    }
    publish_status(false);
  }
}

void Controller::take_requests() {
  while (true) {
    Request request;
    {
      const std::lock_guard lock(queue_mutex_);
      if (queue_.empty()) return;
      request = std::move(queue_.front());
      queue_.pop_front();
    }
    const std::string no_calibration = request.event == SessionEvent::calibrate ? why_no_calibration() : "";
    SessionOutcome outcome{.from = machine_.state(), .to = machine_.state(), .event = request.event, .action = SessionAction::none, .refusal = no_calibration};
    if (no_calibration.empty()) outcome = machine_.handle(request.event, clock_.now());
    const std::string name(to_string(request.event));
    if (outcome.from == SessionState::idle) story_.begin();
    say_event("trigger", request.source, outcome.refusal.empty() ? name : fmt::format("{} refused: {}", name, outcome.refusal));
    apply(outcome, request.source);
    request.answer.set_value({outcome.refusal.empty(), machine_.state(), std::string(outcome.refusal)});
  }
}

void Controller::take_frames() {
  for (FrameNote note; notes_.pop(note);) {
    apply(machine_.frame(note.there, note.accepted, clock_.now()), "fit");
  }
  if (machine_.body_known() && machine_.running()) publish_body(false);
}

void Controller::watch_cameras() {
  const std::vector<CameraStatus> cameras = pipeline_->cameras();
  news_.cameras(cameras);
  const auto running = std::count_if(cameras.begin(), cameras.end(), [](const CameraStatus& c) { return c.state == CameraState::running; });
  {
    const std::lock_guard lock(shared_mutex_);
    paused_ = running < settings_.minimum_cameras;
    latched_ = machine_.latched();
    body_known_ = machine_.body_known();
    countdown_ = machine_.countdown_left(clock_.now());
  }
  const bool waiting = machine_.running() || machine_.state() == SessionState::countdown || machine_.state() == SessionState::calibrating;
  if (waiting && pipeline_->all_ended()) apply(machine_.handle(SessionEvent::sources_ended, clock_.now()), "cameras");
}

void Controller::watch_rest() {
  news_.backend(fitter_->backend());
  std::vector<std::string> panel_problems;
  {
    const std::lock_guard lock(shared_mutex_);
    panel_problems = panel_.problems;
  }
  news_.panel(panel_problems);
  const hal::MonotonicTime now = clock_.now();
  if (now >= next_drift_look_) {
    next_drift_look_ = now + 500ms;
    if (const auto problem = news_.drift(fitter_->drift(), pipeline_->cameras())) {
      const std::lock_guard lock(shared_mutex_);
      drift_problem_ = *problem;
    }
  }
  if (settings_.credential_problem && now >= next_credential_look_) {
    next_credential_look_ = now + 1s;
    const std::string problem = settings_.credential_problem();
    {
      const std::lock_guard lock(shared_mutex_);
      credential_problem_ = problem;
    }
    news_.credentials(problem);
  }
}

void Controller::watch_disk() {
  const hal::MonotonicTime now = clock_.now();
  if (now < next_disk_look_) return;
  next_disk_look_ = now + 1s;
  const PatientProgress::Busy busy(progress_);  // a disk that is slow to answer is no hung thread
  const DiskSpace disk = disk_space(settings_.session_directory);
  const std::lock_guard lock(shared_mutex_);
  disk_ = disk;
}

void Controller::apply(const SessionOutcome& outcome, const std::string& source) {
  const std::string cause(to_string(outcome.event));
  if (outcome.action == SessionAction::begin) begin_session();
  if (outcome.action == SessionAction::end) end_session(cause, std::string(to_string(outcome.from)));
  if (outcome.action == SessionAction::calibrate) settings_.calibrator->begin(source);
  if (outcome.action == SessionAction::cancel_calibration) settings_.calibrator->cancel();
  if (!outcome.changed()) return;
  state_.store(outcome.to, std::memory_order_release);
  const std::string text = fmt::format("{} -> {} ({})", to_string(outcome.from), to_string(outcome.to), cause);
  log_line(LogLevel::info, text);
  say_event("state", source, text);
  publish_status(true);
}

void Controller::begin_session() {
  // After this the fit thread's frames carry the new state already.
  state_.store(SessionState::estimating, std::memory_order_release);
  SessionInfo info = settings_.info;
  session_began_utc_ = info.began_utc_ns = clock_.utc_now().time_since_epoch().count();
  info.id = make_session_id(info.began_utc_ns);
  info.events = story_.events();
  log_trouble_told_ = false;
  bodies_told_ = 0;
  {
    const std::lock_guard lock(shared_mutex_);
    session_.clear(), folder_.clear();  // the last one's are not this one's while the disk is waited for
  }
  std::filesystem::path folder;
  std::string alarm;
  try {
    folder = open_folder(info);
  } catch (const std::exception& e) {
    alarm = fmt::format("this session is live only: {}", e.what());
    log_message(LogLevel::error, Message::session_not_saved, alarm);
  }
  set_alarm(alarm);
  {
    const std::lock_guard lock(shared_mutex_);
    session_ = info.id;
    folder_ = folder;
    last_known_ = false;
    bodies_ = {};
    body_due_ = false;
    frames_ = 0;
    remark_ = "";
  }
  pipeline_->activate();
  log_message(LogLevel::info, Message::session_began, fmt::format("session {} begins{}{}", info.id, folder.empty() ? "" : " in ", folder.string()));
}

std::filesystem::path Controller::open_folder(const SessionInfo& info) {
  const PatientProgress::Busy busy(progress_);
  for (const auto& line : prune_sessions(settings_.session_directory, settings_.quota_bytes, settings_.max_age_days, info.began_utc_ns))
    log_line(LogLevel::info, line);
  seal_ = settings_.seal_to ? Seal::fresh(*settings_.seal_to) : nullptr;
  std::filesystem::path folder = create_session_folder(settings_.session_directory, info, seal_.get());
  try {
    log_.open(folder, seal_.get());
  } catch (const std::exception&) {
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);  // it says `running`, and nothing will ever come into it
    throw;
  }
  return folder;
}

/// At once and not only at the end: somebody could still make room for the next one, or ask the visitor to come again.
void Controller::watch_log() {
  if (log_trouble_told_ || !machine_.running() || !log_.broken()) return;
  log_trouble_told_ = true;
  log_message(LogLevel::error, Message::session_not_saved, log_.problem());
  set_alarm(log_.problem());
  say_event("fault", "session", log_.problem());
}

void Controller::end_session(const std::string& reason, const std::string& state_at_end) {
  pipeline_->deactivate();
  take_frames();
  publish_body(true);  // the last one's, whose files the session gets
  {
    const PatientProgress::Busy busy(progress_);
    log_.close();
  }
  SessionInfo info = settings_.info;
  std::filesystem::path folder;
  {
    const std::lock_guard lock(shared_mutex_);
    info.id = session_;
    folder = folder_;
  }
  info.began_utc_ns = session_began_utc_;
  info.ended_utc_ns = clock_.utc_now().time_since_epoch().count();
  info.result = "complete";
  info.reason = reason;
  info.state_at_end = state_at_end;
  info.events = story_.events();
  info.events.push_back({info.ended_utc_ns, "state", "session", fmt::format("{} -> finishing ({})", state_at_end, reason)});
  info.events_left_out = story_.left_out();
  const PipelineCounters counters = pipeline_->counters();
  info.groups = counters.groups;
  info.groups_dropped = counters.groups_dropped;
  info.frames_unmatched = counters.frames_unmatched;
  info.frames_not_logged = log_.lost();
  info.latency = pipeline_->latency();
  for (int s = 0; s < kStages; ++s) info.stages[static_cast<std::size_t>(s)] = pipeline_->stage(static_cast<Stage>(s));
  if (!log_.problem().empty()) {
    info.result = "interrupted";  // by the disk: the last frames are not in it
    info.reason = log_.problem();
    if (!std::exchange(log_trouble_told_, true)) log_message(LogLevel::error, Message::session_not_saved, log_.problem());
    set_alarm(log_.problem());
  }
  finisher_ = std::thread([this, session = Ended{std::move(info), std::move(folder), std::exchange(seal_, nullptr), log_.written()}]() mutable {
    write_files(std::move(session));
    files_done_ = true;
    bell_.ring();
  });
}

void Controller::write_files(Ended session) {
  if (session.folder.empty()) return;
  unsaved_.push_back(std::move(session));
  std::erase_if(unsaved_, [&](const Ended& one) { return save(one, &one == &unsaved_.back()); });
  // The next start brings the others to their end.
  if (unsaved_.size() > kUnsaved) unsaved_.erase(unsaved_.begin());
}

/// False when it is worth another try.
bool Controller::save(Ended session, bool newest) {
  SessionInfo& info = session.info;
  std::error_code ignored;
  if (!newest && !std::filesystem::exists(session.folder, ignored)) return true;  // somebody has deleted it
  try {
    const std::vector<FrameRecord> frames = read_session_log(session.folder, session.seal.get());
    if (frames.size() < session.written && info.result == "complete") {
      info.result = "interrupted";  // by the disk, which has lost what it had taken
      info.reason = fmt::format("{} of {} frames could not be read back from the disk", session.written - frames.size(), session.written);
      log_message(LogLevel::error, Message::session_not_saved, info.reason);
      set_alarm(fmt::format("session {}: {}", info.id, info.reason));
    }
    SessionSummary summary = finish_session(session.folder, info, frames, settings_.models, settings_.truth.get(), session.seal.get());
    log_message(LogLevel::info, Message::session_complete,
                fmt::format("session {} is complete: {} frames, {:.1f} frames/s, in {}", info.id, summary.frames, summary.fps, session.folder.string()));
    if (!newest) return true;
    const std::lock_guard lock(shared_mutex_);
    summary_ = std::move(summary);
  } catch (const std::exception& e) {
    const std::string alarm = fmt::format("session {} could not be saved: {}", info.id, e.what());
    log_message(LogLevel::error, Message::session_not_saved, alarm);
    set_alarm(alarm);
    return false;
  }
  return true;
}

void Controller::publish_body(bool at_once) {
  // A fit that cannot decide who stands there must not flood its readers, who keep the newest only.
  constexpr auto kBetweenBodies = 1s;
  const hal::MonotonicTime now = clock_.now();
  if (!at_once && bodies_told_ > 0 && now - last_body_ < kBetweenBodies) return;
  FrameRecord frame;
  std::string session;
  {
    const std::lock_guard lock(shared_mutex_);
    if (!std::exchange(body_due_, false)) return;
    session = session_;
    frame = accepted_;
  }
  last_body_ = now;
  if (bodies_told_++ > 0) {
    const std::string text = "another person's body is accepted; it is the session's from now on";
    log_line(LogLevel::info, text);
    say_event("state", "fit", text);
  }
  const fit::BodyModel* model = settings_.models.of(frame.sex);
  if (model && dds_) dds_->publish(body_sample(frame, *model, session));
}

void Controller::publish_status(bool force) {
  if (!dds_ || (!force && clock_.now() - last_look_ < 100ms)) return;
  last_look_ = clock_.now();
  const DaemonStatus s = status();
  std::string key = fmt::format("{} {} {} {} {} {}", static_cast<int>(s.state), s.degraded, s.paused, s.latched, s.session, s.alarm);
  for (const auto& camera : s.cameras) key += to_string(camera.state);
  const hal::MonotonicTime now = clock_.now();
  if (!force && key == status_key_ && now - last_status_ < 1s) return;
  status_key_ = std::move(key);
  last_status_ = now;
  dds_->publish(status_sample(s));
}

void Controller::set_alarm(const std::string& text) {
  const std::lock_guard lock(shared_mutex_);
  alarm_ = text;
}

void Controller::set_panel(PanelStatus panel) {
  const std::lock_guard lock(shared_mutex_);
  panel_ = std::move(panel);
}

void Controller::say_event(const std::string& kind, const std::string& source, const std::string& text) {
  story_.note({clock_.utc_now().time_since_epoch().count(), kind, source, text});
  if (settings_.on_event) settings_.on_event(kind, source, text);
  if (dds_) dds_->publish_event(kind, source, text);
}

DaemonStatus Controller::status() const {
  DaemonStatus out;
  out.software = settings_.info.software;
  out.state = state();
  out.minimum_cameras = settings_.minimum_cameras;
  if (pipeline_) {
    out.cameras = pipeline_->cameras();
    out.counters = pipeline_->counters();
    out.latency = pipeline_->latency();
    for (int s = 0; s < kStages; ++s) out.stages[static_cast<std::size_t>(s)] = pipeline_->stage(static_cast<Stage>(s));
  }
  out.degraded = std::any_of(out.cameras.begin(), out.cameras.end(), [](const CameraStatus& c) { return c.state != CameraState::running; });
  if (dds_) {
    out.dds_failures = dds_->failures();
    out.dds_problem = dds_->last_failure();
  }
  out.dds_absent = !settings_.dds_absent.empty();
  if (out.dds_absent) out.dds_problem = settings_.dds_absent;
  if (fitter_) {
    out.backend = fitter_->backend();
    out.drift = fitter_->drift();
  }
  if (settings_.calibrator) out.calibration = settings_.calibrator->status();
  if (settings_.calibrated_utc_ns > 0)
    out.calibration_age_s = static_cast<double>(clock_.utc_now().time_since_epoch().count() - settings_.calibrated_utc_ns) / 1e9;
  out.calibration_residual = settings_.calibration_residual;
  const std::lock_guard lock(shared_mutex_);
  out.paused = paused_;
  out.latched = latched_;
  out.body_known = body_known_;
  out.countdown_seconds = countdown_;
  out.panel = panel_;
  out.disk = disk_;
  out.session_alarm = alarm_;
  out.dds_security = settings_.dds_security;
  out.credential_problem = credential_problem_;
  out.drift_problem = drift_problem_;
  out.alarm = !alarm_.empty()                 ? alarm_
              : !panel_.problems.empty()      ? panel_.problems.front()
              : !settings_.dds_absent.empty() ? settings_.dds_absent
              : !credential_problem_.empty()  ? credential_problem_
                                              : drift_problem_;
  if (out.alarm.empty() && out.calibration.restart) out.alarm = "a new calibration takes effect when boothd is started again";
  out.session = session_;
  out.session_folder = folder_.string();
  out.remark = remark_;
  const bool followed = out.state == SessionState::tracking && last_known_ && last_.person != PersonState::lost;
  if (out.remark.empty() && followed && coverage_is_partial(static_cast<double>(last_.coverage), last_.cameras))
    out.remark = partial_coverage_sentence(static_cast<double>(last_.coverage));
  out.last = last_;
  out.last_known = last_known_;
  out.last_summary = summary_;
  if (frames_ > 1 && last_frame_ > first_frame_) out.fps = static_cast<double>(frames_ - 1) / hal::seconds(last_frame_ - first_frame_);
  return out;
}

}  // namespace booth::daemon
