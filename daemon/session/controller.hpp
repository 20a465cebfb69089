// Runs the booth: hears requests, follows the session through its states, opens and finishes its files, tells the world.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/dds/dds_link.hpp"
#include "daemon/health/patient_progress.hpp"
#include "daemon/io/disk_space.hpp"
#include "daemon/pipeline/accepted_body.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "daemon/record/session_files.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/session/booth_news.hpp"
#include "daemon/session/calibrator.hpp"
#include "daemon/session/session_machine.hpp"
#include "daemon/session/session_story.hpp"
#include "hal/clock.hpp"
#include "hal/ground_truth.hpp"
#include "hal/status_light.hpp"

namespace booth::daemon {

struct ControllerSettings {
  std::filesystem::path session_directory;
  std::int64_t quota_bytes = 0, max_age_days = 0;
  SessionMachine::Limits limits;
  int minimum_cameras = 2;
  SessionInfo info;  ///< what is the same in every session of this daemon
  SessionModels models;
  std::shared_ptr<const hal::GroundTruth> truth;  ///< may be null
  std::shared_ptr<const PublicKey> seal_to{};     ///< sessions are sealed to it; null: they are not
  std::int64_t calibrated_utc_ns = 0;             ///< when the cameras were calibrated; 0: not known
  double calibration_residual = -1;               ///< between two cameras, on views held out, metres; negative: not known
  /// Hears of everything that happens, on the controller's thread: kind, source, text. May be empty.
  std::function<void(const std::string&, const std::string&, const std::string&)> on_event{};
  std::string dds_absent{};                           ///< why this booth is not on DDS although it should be, an alarm; empty: it is, or it should not be
  std::string dds_security = "off";                   ///< what status shows of it: whose credentials, until when
  std::function<std::string()> credential_problem{};  ///< asked every second: what a person should look after; may be empty
  Calibrator* calibrator = nullptr;                   ///< outlives the controller; null: calibrations are refused
};

/// Answer to a request.
struct ControlAnswer {
  bool accepted = false;
  SessionState state{};  ///< after the request
  std::string text;      ///< why it was refused
};

/// Buttons and light, as the link to them sees them.
struct PanelStatus {
  bool present = false;
  hal::LightShow light;
  std::vector<std::string> problems;
};

/// Everything that status shows, taken at one moment.
struct DaemonStatus {
  std::string software;  ///< "boothd VERSION" of the process that runs, which need not be the version that is installed
  SessionState state{};
  bool degraded = false, paused = false, latched = false, body_known = false;
  int countdown_seconds = 0;  ///< until the session begins; 0: no countdown runs
  std::string alarm;          ///< the worst thing that a person should look after
  std::string session_alarm;  ///< that part of it which concerns the saving of sessions
  std::string session, session_folder, remark;
  PanelStatus panel;
  std::vector<CameraStatus> cameras;
  int minimum_cameras = 0;
  PipelineCounters counters;
  LatencySummary latency;
  std::array<LatencySummary, kStages> stages{};
  double fps = 0;
  FrameRecord last;  ///< the last fitted frame of this session
  bool last_known = false;
  std::optional<SessionSummary> last_summary;  ///< of the last session that was finished
  BackendStatus backend;
  std::vector<CameraDriftStatus> drift;  ///< of each camera; empty where nobody watches
  std::string drift_problem;             ///< cameras that do not stand where the calibration says; empty when all do
  std::uint64_t dds_failures = 0;
  std::string dds_problem;
  bool dds_absent = false;  ///< it should be there and is not; dds_problem says why
  std::string dds_security, credential_problem;
  CalibrationStatus calibration;
  double calibration_age_s = -1;     ///< of the one that the cameras have; negative: not known, also where the clock says that it is still to come
  double calibration_residual = -1;  ///< its held-out error between two cameras, metres; negative: not known
  DiskSpace disk;                    ///< where sessions are kept, a second ago at most
};

/// Public functions are thread-safe unless they say otherwise.
class Controller final : public FrameSink {
 public:
  Controller(ControllerSettings settings, hal::Clock& clock);
  ~Controller() override;

  /// Closes what an earlier boothd left interrupted, then begins to work with the pipeline whose sink this is. Call once; all outlive shutdown(). `dds`
  /// may be null. A directory that cannot be written is an alarm, not an exception.
  void run(Pipeline& pipeline, FrameFitter& fitter, DdsLink* dds);

  /// Queues an event and waits for its answer.
  ControlAnswer request(SessionEvent event, const std::string& source);
  /// Ends a running session, waits until its files are written, ends the thread. Not concurrently with request().
  void shutdown(const std::string& reason);

  /// What the panel shows and complains of; told in status, events and log.
  void set_panel(PanelStatus panel);

  DaemonStatus status() const;
  SessionState state() const { return state_.load(std::memory_order_acquire); }
  /// Moves with every turn of the controller's thread. A slow disk may hold up a session's beginning or end for many seconds, and that is no reason to end the
  /// daemon: meanwhile it moves with the time, for a minute at most.
  std::uint64_t progress() const { return progress_.value(); }

  void publish(FrameRecord& record) noexcept override;
  void log(const FrameRecord& record) noexcept override;

 private:
  struct Request {
    SessionEvent event;
    std::string source;
    std::promise<ControlAnswer> answer;
  };
  /// What the thread needs to know of a frame.
  struct FrameNote {
    bool there = false, accepted = false;
  };

  void loop();
  void take_requests();
  void take_frames();
  void watch_cameras();
  void watch_rest();  ///< who computes, panel, cameras off their places, credentials
  void watch_disk();
  void watch_calibration();
  void watch_log();  ///< frames that cannot be written
  std::string why_no_calibration() const;
  void apply(const SessionOutcome& outcome, const std::string& source);
  void begin_session();
  std::filesystem::path open_folder(const SessionInfo& info);
  void end_session(const std::string& reason, const std::string& state_at_end);
  /// A session that has ended and whose files are still to be written.
  struct Ended {
    SessionInfo info;
    std::filesystem::path folder;  ///< empty: it was live only
    std::shared_ptr<const Seal> seal;
    std::uint64_t written = 0;  ///< frames that the log took
  };
  void write_files(Ended session);
  bool save(Ended session, bool newest);
  /// The body that was accepted since the last call; where one was told only just now it waits, unless `at_once`.
  void publish_body(bool at_once);
  void publish_status(bool force);
  void set_alarm(const std::string& text);
  void say_event(const std::string& kind, const std::string& source, const std::string& text);

  ControllerSettings settings_;
  hal::Clock& clock_;
  Pipeline* pipeline_ = nullptr;
  FrameFitter* fitter_ = nullptr;
  DdsLink* dds_ = nullptr;

  Wakeup bell_;
  std::mutex queue_mutex_;
  std::deque<Request> queue_;
  static constexpr std::size_t kQueue = 64;
  bool ending_ = false;  ///< nothing begins any more

  std::atomic<SessionState> state_{SessionState::idle};
  PatientProgress progress_{clock_};
  IndexRing<FrameNote, 256> notes_;
  SessionLog log_;

  // The controller thread's alone.
  SessionMachine machine_;
  SessionStory story_;
  bool log_trouble_told_ = false;
  int bodies_told_ = 0;  ///< in this session
  BoothNews news_;
  CalibrationStatus calibration_said_;
  hal::MonotonicTime last_idle_{}, last_status_{}, last_look_{}, next_credential_look_{}, next_drift_look_{}, next_disk_look_{}, last_body_{};
  std::string status_key_;
  std::int64_t session_began_utc_ = 0;
  std::shared_ptr<const Seal> seal_;  ///< of this session; null: it is not sealed

  mutable std::mutex shared_mutex_;  ///< guards what follows
  FrameRecord last_;
  bool last_known_ = false;
  AcceptedBody bodies_;    ///< of this session
  FrameRecord accepted_;   ///< the frame in which the last of them was accepted
  bool body_due_ = false;  ///< it is still to be told
  hal::MonotonicTime first_frame_{}, last_frame_{};
  std::uint64_t frames_ = 0;
  std::string alarm_, session_, credential_problem_, drift_problem_;
  const char* remark_ = "";  ///< a constant sentence of the fitter's: log() may not allocate
  std::filesystem::path folder_;
  PanelStatus panel_;
  DiskSpace disk_;
  int countdown_ = 0;
  bool latched_ = false, paused_ = false, body_known_ = false;
  std::optional<SessionSummary> summary_;

  std::thread finisher_;
  static constexpr std::size_t kUnsaved = 16;
  std::vector<Ended> unsaved_;  ///< the finisher's alone: the disk did not take them, and perhaps takes them after the next session
  std::atomic<bool> files_done_{false};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace booth::daemon
