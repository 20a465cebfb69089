// The daemon's main thread: puts the rooms together, waits for signals, feeds the watchdog, takes everything down in order.
#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <thread>

#include "daemon/calibrate/booth_calibration.hpp"
#include "daemon/calibrate/configured.hpp"
#include "daemon/calibrate/infrared_tap.hpp"
#include "daemon/config/load.hpp"
#include "daemon/ctl/control_protocol.hpp"
#include "daemon/ctl/control_server.hpp"
#include "daemon/ctl/panel_protocol.hpp"
#include "daemon/ctl/record_protocol.hpp"
#include "daemon/dds/configured.hpp"
#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/network_there.hpp"
#include "daemon/dds/ros2/cloud_tap.hpp"
#include "daemon/dds/ros2/ros2_mirror.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/drivers_factory.gpio.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/drivers_factory.recorder.hpp"
#include "daemon/health/another_try.hpp"
#include "daemon/health/checks.hpp"
#include "daemon/health/failed_light.hpp"
#include "daemon/health/log.hpp"
#include "daemon/health/messages.hpp"
#include "daemon/health/notify.hpp"
#include "daemon/health/progress_watch.hpp"
#include "daemon/health/system_calls.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "daemon/record/booth_tap.hpp"
#include "daemon/record/housekeeper.hpp"
#include "daemon/record/retention.hpp"
#include "daemon/seal/sealed_file.hpp"
#include "daemon/session/controller.hpp"
#include "daemon/session/panel_link.hpp"
#include "daemon/session/remote_commands.hpp"
#include "daemon/start_stages.hpp"

namespace booth::daemon {
namespace {

constexpr auto kNetworkPatience = std::chrono::seconds(4);  ///< READY within ten seconds, whatever the network does
constexpr auto kWatchPatience = std::chrono::seconds(10);   ///< a thread that has not moved for so long hangs

/// Removes the socket's file, also when the start fails later on.
struct SocketFile {
  explicit SocketFile(std::filesystem::path p) : path(std::move(p)) {}
  ~SocketFile() { ::unlink(path.c_str()); }
  SocketFile(const SocketFile&) = delete;
  std::filesystem::path path;
};

/// Ends the session before anything is taken apart that it needs, on every way out.
struct ShutdownFirst {
  Controller& controller;
  ~ShutdownFirst() { controller.shutdown("signal"); }
};

/// The booth's credentials, examined; nothing where security is off. Whatever is wrong with them ends the start: nothing is ever published in the plain
/// instead.
std::optional<Credentials> open_credentials(const Config& config, bool check_only) {
  if (!config.dds.enabled) return std::nullopt;
  // Before the first start there are none yet, and whoever only looks at a configuration makes none.
  std::error_code error;
  if (check_only && config.dds.credentials.empty() && !std::getenv("CREDENTIALS_DIRECTORY") && !std::filesystem::exists(config.dds.self_issued, error))
    return std::nullopt;
  try {
    std::optional<Credentials> out = dds_credentials(config, Role::booth, !check_only);
    for (const auto& warning : out ? out->warnings : std::vector<std::string>{}) log_line(LogLevel::warning, "DDS Security: " + warning);
    return out;
  } catch (const CredentialError& e) {
    throw StartFailure(e.may_pass ? kUnavailable : kConfiguration, e.what());
  }
}

/// Whom sessions and recordings are sealed to; null where they are not. Throws: a key that is asked for and not there means no start, not plain files.
std::shared_ptr<const PublicKey> recipient(const Config& config) {
  if (config.privacy.seal_to.empty()) return nullptr;
  auto key = std::make_shared<const PublicKey>(read_public_key(config.privacy.seal_to));
  (void)Seal::fresh(*key);  // a key that nothing can be sealed to is noticed now
  return key;
}

ControllerSettings controller_settings(const Config& config, const DepthSource& source, const FitSetup& fit) {
  ControllerSettings out;
  out.session_directory = config.session.directory;
  out.quota_bytes = config.session.quota_bytes;
  out.max_age_days = config.session.max_age_days;
  out.limits.lost = hal::from_seconds(config.session.lost_seconds);
  out.limits.search = hal::from_seconds(config.session.search_seconds);
  out.limits.session = hal::from_seconds(config.session.max_seconds);
  out.limits.estimate = hal::from_seconds(config.session.estimate_seconds);
  out.limits.pause = hal::from_seconds(config.session.pause_seconds);
  out.limits.countdown = hal::from_seconds(config.session.countdown_seconds);
  out.minimum_cameras = static_cast<int>(config.cameras.minimum);
  out.models = fit.models;
  out.truth = source.truth;
  out.info.booth = config.booth.id;
  out.info.software = "boothd " BOOTHD_VERSION;
  out.info.source = source.name;
  out.info.preset = config.fit.preset;
  out.info.models = fit.versions;
  out.info.seed = static_cast<std::uint64_t>(config.fit.seed);
  out.info.threads = static_cast<int>(config.fit.threads);
  for (const auto& camera : source.cameras) out.info.cameras.push_back(camera->description().name);
  out.info.calibration = source.calibration;
  out.calibrated_utc_ns = calibrated_utc_ns(source.calibration);
  out.calibration_residual = source.calibration.held_out_corner;
  return out;
}

Housekeeper::Settings housekeeping(const Config& config, hal::FlightRecorder& recorder, hal::Clock& clock) {
  Housekeeper::Settings out;
  out.prune = [&config, &clock, &recorder] {
    const std::int64_t now = clock.utc_now().time_since_epoch().count();
    auto said = prune_sessions(config.session.directory, config.session.quota_bytes, config.session.max_age_days, now);
    const auto in_work = [&recorder](const std::string& name) {
      const hal::RecorderStatus status = recorder.status(false);
      const auto writes = [&](const auto& one) { return one.running && std::filesystem::path(one.path).filename() == name; };
      return writes(status.recording) || writes(status.snapshot);
    };
    for (auto& line : prune_recordings(config.record.directory, config.record.quota_bytes, config.record.max_age_days, now, in_work))
      said.push_back(std::move(line));
    return said;
  };
  if (config.record.on_fault)
    out.snapshot = [&recorder](const std::string& fault) {
      const SnapshotAnswer answer = request_snapshot(recorder, "fault: " + fault);
      return (answer.accepted ? "what led to it is being written to " : "what led to it is not written: ") + answer.text;
    };
  out.log = [](const std::string& line) { log_line(LogLevel::info, line); };
  return out;
}

Pipeline::Settings pipeline_settings(const Config& config) {
  Pipeline::Settings out;
  out.minimum_cameras = static_cast<int>(config.cameras.minimum);
  return out;
}

/// Whether somebody starts boothd again when it ends with kAgain.
bool is_supervised() {
  const char* socket = std::getenv("NOTIFY_SOCKET");
  return socket != nullptr && *socket != '\0';
}

/// Held for as long as boothd lives: a second one, with a socket of its own, would close the first one's session as if that were dead. Where the folder cannot
/// be made or locked nothing is held: what cannot be written there is told later, by name. Throws std::runtime_error where there is another.
UniqueFd only_one_with(const std::filesystem::path& sessions) {
  std::error_code ignored;
  std::filesystem::create_directories(sessions, ignored);
  UniqueFd folder(::open(sessions.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() >= 0 && ::flock(folder.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw std::runtime_error(
        fmt::format("{}: another boothd writes its sessions there; stop that one, or choose another session.directory", sessions.string()));
  return folder;
}

/// Buttons and light, where there are any. Taken down before the session: whoever presses now is not heard any more.
struct PanelParts {
  PanelDevice device;
  std::optional<PanelLink> link;
};

bool stop_is_pending() {
  sigset_t pending;
  return ::sigpending(&pending) == 0 && (::sigismember(&pending, SIGTERM) == 1 || ::sigismember(&pending, SIGINT) == 1);
}

/// The network that DDS should have and does not have yet; null where it is there, and where nobody would start boothd again when it comes. Most boxes have
/// their address seconds after boothd could start, and that long it is waited for; for a switch that comes a minute later the visitor does not wait.
std::unique_ptr<NetworkThere> missing_network(const Config& config, StartStages& stages) {
  if (!config.dds.enabled || !is_supervised()) return nullptr;
  auto network = stages.run(kUnavailable, {"dds.interface"}, [&] { return std::make_unique<NetworkThere>(config.dds.interface); });
  for (const auto until = std::chrono::steady_clock::now() + kNetworkPatience; !network->there(); std::this_thread::sleep_for(std::chrono::milliseconds(50)))
    if (std::chrono::steady_clock::now() >= until || stop_is_pending()) break;
  if (network->there()) return nullptr;
  log_line(LogLevel::warning, network->sentence());
  return network;
}

/// Waits for SIGTERM or SIGINT; meanwhile tells systemd that all threads move, or why not. Returns the exit status.
ExitStatus watch(const sigset_t& signals, const Pipeline& pipeline, const Controller& controller, const PanelParts& panel, const Calibrator& calibrator,
                 const NetworkThere* awaited, const hal::Clock& clock) {
  const bool supervised = is_supervised();
  ProgressWatch progress(kWatchPatience);
  const auto interval = watchdog_interval();
  hal::MonotonicTime next_ping{};
  std::string said;
  while (true) {
    const timespec wait{0, 250'000'000};
    const int signal = ::sigtimedwait(&signals, nullptr, &wait);
    if (signal == SIGTERM || signal == SIGINT) {
      log_message(LogLevel::info, Message::stopping, fmt::format("{}: stopping", signal == SIGTERM ? "SIGTERM" : "SIGINT"));
      return kStopped;
    }
    if (supervised && controller.state() == SessionState::idle && calibrator.status().restart) {
      log_message(LogLevel::info, Message::stopping, "boothd begins anew, with the new calibration");
      return kAgain;
    }
    if (awaited && controller.state() == SessionState::idle && awaited->there()) {
      log_message(LogLevel::info, Message::stopping, "boothd begins anew, with the network that has come");
      return kAgain;
    }
    if (signal == SIGHUP) log_line(LogLevel::warning, "SIGHUP: the configuration is read at the start only; restart boothd to apply changes");

    auto counters = pipeline.progress();
    counters.push_back(controller.progress());
    if (panel.link) {
      counters.push_back(panel.link->progress());
      counters.push_back(panel.device.panel->progress());
    }
    const hal::MonotonicTime now = clock.now();
    if (progress.stalled(counters, now.time_since_epoch()) >= 0) {
      // Saving is hopeless with a hung thread; the session is closed as interrupted at the next start.
      log_message(LogLevel::error, Message::thread_stalled, "a thread of the pipeline does not move any more");
      return kInternal;
    }
    if (interval.count() > 0 && now >= next_ping) {
      notify_watchdog();
      next_ping = now + interval;
    }
    std::string status(to_string(controller.state()));
    status += fmt::format(", {} of {} cameras", pipeline.cameras_running(), pipeline.cameras().size());
    if (status != said) notify_status(said = status);
  }
}

/// What the last moments were, for whoever asks later; not for ever, because the disk may be what hangs.
void save_black_box(hal::FlightRecorder& recorder) {
  if (!request_snapshot(recorder, "a thread hangs").accepted) return;
  for (int turn = 0; turn < 200 && recorder.status(false).snapshot.running; ++turn) {
    notify_watchdog();  // bounded; else what led to it would be lost
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

/// From here on boothd cannot run programs, open sockets of the network or map code. Where the kernel cannot, or the configuration does not want it, the unit's
/// list holds.
std::unique_ptr<SystemCallGuard> narrow_system_calls(const Config& config) {
#ifdef BOOTHD_SANITIZED
  return nullptr;  // sanitizers need more
#endif
  if (config.hardening.system_calls != "narrow" || config.fit.backend != "cpu" || config.cameras.kinect2.decoder != "cpu") return nullptr;
  try {
    return std::make_unique<SystemCallGuard>([told = std::set<int>()](const std::string& name, int number, std::uint32_t thread) mutable {
      if (told.insert(number).second)
        log_message(LogLevel::warning, Message::system_call_refused,
                    fmt::format("system call {} ({}) of thread {} is refused: it is not in boothd's list; told once", name, number, thread));
    });
  } catch (const std::exception& e) {
    log_line(LogLevel::warning, e.what());
    return nullptr;
  }
}

void print_plan(const std::vector<MemoryItem>& plan) {
  std::size_t total = 0;
  std::cout << "\n# Memory taken before the first frame\n";
  for (const auto& item : plan) {
    std::cout << fmt::format("# {:<34}{:>10.1f} MiB\n", item.what, static_cast<double>(item.bytes) / 1048576.0);
    total += item.bytes;
  }
  std::cout << fmt::format("# {:<34}{:>10.1f} MiB\n", "total", static_cast<double>(total) / 1048576.0);
}

/// What a start and a check have in common.
struct Parts {
  std::optional<Credentials> credentials;
  std::shared_ptr<const PublicKey> seal_to;
  DepthSource source;
  FitSetup fit;  ///< in a check without a fitter where there are no cameras or models
};

Parts make_parts(const Config& config, StartStages& stages, bool check_only) {
  Parts out;
  for (auto& problem : panel_problems(config)) stages.fail(kConfiguration, std::move(problem));
  out.credentials = stages.run(kConfiguration, {"dds.security", "dds.credentials", "dds.self_issued"}, [&] { return open_credentials(config, check_only); });
  out.seal_to = stages.run(kConfiguration, {"privacy.seal_to"}, [&] { return recipient(config); });
  DepthSource& source = out.source = stages.run(kUnavailable,
                                                {"cameras.driver", "cameras.recording.path", "cameras.kinect2.serials", "cameras.kinect2.calibration",
                                                 "cameras.kinect2.cache", "cameras.synthetic.body", "models.directory"},
                                                [&] { return open_source(config); });
  const std::vector<std::string_view> of_models{"models.directory"};
  if (!source.clock) {  // in a check that has complained about the cameras
    stages.run(kConfiguration, of_models, [&] { return read_models(config); });
    return out;
  }
  if (static_cast<int>(source.cameras.size()) > kMaxCameras)
    stages.fail(kConfiguration, {{"cameras.driver", "cameras.recording.path", "cameras.kinect2.calibration"},
                                 fmt::format("{} has {} cameras; boothd works with at most {}", source.name, source.cameras.size(), kMaxCameras)});
  if (static_cast<std::int64_t>(source.cameras.size()) < config.cameras.minimum)
    stages.fail(kConfiguration,
                {{"cameras.minimum", "cameras.driver"},
                 fmt::format("{} has {} cameras, fewer than cameras.minimum = {}", source.name, source.cameras.size(), config.cameras.minimum)});
  out.fit = stages.run(kConfiguration, of_models, [&] { return make_fit_setup(config, source.cameras, source.background); });
  return out;
}

std::vector<MemoryItem> memory_plan(const Config& config, Parts& parts) {
  DepthSource& source = parts.source;
  Controller controller(controller_settings(config, source, parts.fit), *source.clock);
  Pipeline pipeline(pipeline_settings(config), source.cameras, *source.clock, *parts.fit.fitter, controller);
  auto plan = pipeline.memory_plan();
  plan.push_back({"session log ring", SessionLog::memory_bytes()});
  plan.push_back({"last moments (record.*)", recorder_memory(config, source)});
  if (const DecodeBytes decode = decode_memory(config, source.cameras.size()); decode.device > 0) {
    plan.push_back({"pinned for the depth decode", decode.pinned});
    plan.push_back({"depth decode on the device", decode.device});
  }
  if (config.dds.enabled && config.dds.ros2) plan.push_back({"ROS 2 mirror (dds.ros2)", Ros2Mirror::memory_bytes()});
  return plan;
}

/// No mistakes: a chip may be plugged in later, and another program may let go of a line.
void warn_of_absent_lines(const LoadedConfig& settings) {
  DoctorInputs in;
  in.config = settings.config;
  in.gpio = list_gpio_chips();
  for (const Check& one : check_gpio(in))
    if (one.result == CheckResult::error)
      log_line(LogLevel::warning, settings.placed({{"gpio.chip", "gpio.start", "gpio.stop", "gpio.emergency_stop", "gpio.light", "gpio.buzzer"},
                                                   one.name == "chip" ? one.seen : one.name + ": " + one.seen}) +
                                      (one.advice.empty() ? "" : "; " + one.advice));
}

Message message_of(ExitStatus status) {
  return status == kConfiguration ? Message::configuration_wrong : status == kInternal ? Message::internal_fault : Message::start_failed;
}

/// The configuration and the plan as far as they are known, then everything that is wrong. The log's level stays as it is: whoever asks is told all.
ExitStatus check_configuration(const LoadedConfig& settings, const std::vector<std::string>& problems) {
  if (!problems.empty()) std::cout << "# There are mistakes: in the place of each wrong value stands the default, or what was set before\n";
  print_config(settings.config, std::cout);
  StartStages stages(settings, StartStages::At::check);
  Parts parts = make_parts(settings.config, stages, true);
  if (parts.fit.fitter)
    print_plan(stages.run(kInternal, {}, [&] { return memory_plan(settings.config, parts); }));
  else
    std::cout << "\n# What memory is taken is not known without the cameras and the models\n";
  std::cout << std::flush;
  warn_of_absent_lines(settings);
  ExitStatus status = problems.empty() ? kStopped : settings.only_device_absent ? kUnavailable : kConfiguration;
  for (const auto& problem : problems) log_message(LogLevel::error, message_of(status), problem);
  for (const auto& failure : stages.failures()) {
    log_message(LogLevel::error, message_of(failure.status), failure.what());
    status = std::max(status, failure.status);  // what must be mended weighs more than what may come by itself
  }
  return status;
}

ExitStatus serve(const LoadedConfig& settings_read, const sigset_t& signals) {
  const Config& config = settings_read.config;
  set_log_level(log_level_by_name(config.log.level));
  StartStages stages(settings_read, StartStages::At::start);
  // First of all: a second boothd must find out that it is one before it touches cameras or the sessions of the first.
  UniqueFd listener = stages.run(kUnavailable, {"control.socket"}, [&] { return listen_unix(config.control.socket); });
  const SocketFile socket_file(config.control.socket);
  Parts parts = make_parts(config, stages, false);
  const std::optional<Credentials>& credentials = parts.credentials;
  const auto& seal_to = parts.seal_to;
  DepthSource& source = parts.source;
  FitSetup& fit = parts.fit;
  const UniqueFd sessions = stages.run(kUnavailable, {"session.directory"}, [&] { return only_one_with(config.session.directory); });
  for (const auto& line : recover_recordings(config)) log_line(LogLevel::warning, line);
  const auto recorder = open_recorder(config, source, seal_to ? seal_files(*seal_to) : hal::SealFiles{});
  InfraredTap infrared;
  infrared.wrap(source.cameras);
  BoothCalibration calibration(calibration_settings(config, infrared, "boothd " BOOTHD_VERSION), infrared, *source.clock);
  tap_cameras(source.cameras, *recorder);
  TappedFitter fitter(*fit.fitter, *recorder);
  Housekeeper housekeeper(housekeeping(config, *recorder, *source.clock));
  ControllerSettings settings = controller_settings(config, source, fit);
  settings.seal_to = seal_to;
  settings.calibrator = &calibration;
  settings.on_event = [&](const std::string& kind, const std::string& from, const std::string& text) {
    recorder->event(kind, from, text);
    if (kind == "fault") housekeeper.fault(text);
  };
  if (credentials) {
    settings.dds_security = credentials_line(*credentials);
    settings.credential_problem = [&] { return expiry_problem(*credentials, utc_seconds(), config.dds.expiry_warning_days); };
    log_line(LogLevel::info, "DDS Security: " + settings.dds_security);
  }
  const auto awaited = missing_network(config, stages);
  // Without any the library speaks within the machine; one that was named and is not there it refuses.
  const bool without_dds = awaited && !config.dds.interface.empty();
  if (without_dds) settings.dds_absent = awaited->sentence();
  Controller controller(std::move(settings), *source.clock);
  std::unique_ptr<DdsLink> dds;
  if (config.dds.enabled && !without_dds) {
    DdsSettings network = dds_settings(config);
    if (credentials) network.identity = credentials->identity;
    network.ros2 = ros2_settings(config, source.cameras);
    dds = stages.run(kUnavailable, {"dds.interface"}, [&] {
      return std::make_unique<DdsLink>(network, *source.clock, [&](DdsCommand command) { return answer_remote_command(command, controller, *recorder); });
    });
  }
  std::optional<CloudTap> cloud_tap;
  if (dds && config.dds.ros2) cloud_tap.emplace(fitter, fit.fitter->observation(), *dds);
  FrameFitter& heard_fitter = cloud_tap ? static_cast<FrameFitter&>(*cloud_tap) : fitter;
  Pipeline pipeline(pipeline_settings(config), source.cameras, *source.clock, heard_fitter, controller);
  controller.run(pipeline, heard_fitter, dds.get());
  const ShutdownFirst shutdown_first{controller};
  PanelParts panel;
  panel.device = open_panel(config, *source.clock);
  if (panel.device.panel) panel.link.emplace(*panel.device.panel, controller);
  const ControlServer server(config.control.socket, std::move(listener), [&](const std::string& line) {
    const auto about_panel = answer_panel_request(line, panel.device.visitor.get());
    if (about_panel) return *about_panel;
    if (auto answer = answer_record_request(line, *recorder)) return *std::move(answer);
    return with_recorder(answer_request(line, controller), *recorder);
  });
  log_message(LogLevel::info, Message::ready,
              fmt::format("boothd {} is ready: {}; {} cameras; control socket {}{}", BOOTHD_VERSION, source.name, source.cameras.size(), config.control.socket,
                          seal_to ? "; sessions and recordings are sealed to key " + seal_to->id() : ""));
  const auto guard = narrow_system_calls(config);
  notify_ready("idle");
  const ExitStatus status = watch(signals, pipeline, controller, panel, calibration, awaited.get(), *source.clock);
  notify_stopping();
  if (status == kInternal) {
    save_black_box(*recorder);
    std::_Exit(kInternal);  // joining a hung thread would hang, too
  }
  return status;
}

/// What is missing may come: then another start is of use.
ExitStatus end_unavailable(const ConfigSources& sources, const sigset_t& signals) {
  return is_supervised() && !pause_before_another_try(sources, signals) ? kStopped : kUnavailable;
}

int run(int argc, char** argv) {
  CLI::App app{"The daemon inside a capture booth: depth cameras in, a person's body and live skeleton out.", "boothd"};
  ConfigSources sources;
  std::string file;
  bool check_only = false, failed_light = false;
  app.add_option("--config", file, "Configuration file; without it /etc/boothd/boothd.toml where it exists");
  app.add_option("--set", sources.assignments, "key=value, over the file's; may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_flag("--check-config", check_only, "Print the resolved configuration, the memory plan and every error, and do nothing else");
  app.add_flag("--failed-light", failed_light, "Show on the light that boothd has failed, until told to stop; boothd-failed.service does so")
      ->excludes("--check-config");
  app.set_version_flag("--version", "boothd " BOOTHD_VERSION);
  app.footer(
      "Exit status: 0 stopped as asked, 64 usage, 69 something needed at the start is missing, 70 internal fault, 75 to be started again, with a new "
      "calibration or the network that has come, 78 configuration.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kStopped : kUsage;
  }
  sources.file = file;

  // Before any thread is started, so that all inherit the mask and only the main thread hears.
  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int s : {SIGTERM, SIGINT, SIGHUP}) ::sigaddset(&signals, s);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE, SIG_IGN);

  try {
    if (failed_light) {
      show_failed_light(sources, signals);
      return kStopped;
    }
    std::vector<std::string> problems;
    const LoadedConfig settings = load_settings(sources, check_only ? &problems : nullptr);
    for (const auto& warning : settings.warnings) log_message(LogLevel::warning, Message::newer_file, warning);
    return check_only ? check_configuration(settings, problems) : serve(settings, signals);
  } catch (const ConfigError& e) {
    // Taken in order: where the last has arrived, all have.
    for (const auto& problem : e.problems())
      (&problem == &e.problems().back() ? log_last_message : log_message)(LogLevel::error,
                                                                          e.only_device_absent ? Message::start_failed : Message::configuration_wrong, problem);
    return e.only_device_absent ? end_unavailable(sources, signals) : kConfiguration;
  } catch (const StartFailure& e) {
    log_last_message(LogLevel::error, message_of(e.status), e.what());
    return e.status == kUnavailable ? end_unavailable(sources, signals) : e.status;
  } catch (const std::exception& e) {
    log_last_message(LogLevel::error, Message::internal_fault, e.what());
    return kInternal;
  }
}

}  // namespace
}  // namespace booth::daemon

// What can still be thrown is a complaint that cannot be made.
int main(int argc, char** argv) { return booth::daemon::run(argc, argv); }  // NOLINT(bugprone-exception-escape)
