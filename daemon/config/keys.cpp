// The table of configuration keys, and the sentences that are made from it.
#include "daemon/config/keys.hpp"
#include "daemon/config/toml_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/config/near_word.hpp"
#include "daemon/dds/ros2/ros_names.hpp"

namespace booth::daemon {
namespace {

template <class... F>
struct Overload : F... {
  using F::operator()...;
};
template <class... F>
Overload(F...) -> Overload<F...>;

std::string check_id(std::string_view v) {
  const auto good = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_'; };
  return !v.empty() && v.size() <= 32 && std::all_of(v.begin(), v.end(), good) ? ""
                                                                               : "must be 1 to 32 letters, digits, '-' or '_' (it names the DDS partition)";
}

std::string check_socket(std::string_view v) {
  // sockaddr_un holds 108 bytes, the closing zero included.
  return !v.empty() && v.size() < 108 ? "" : "must be a path of 1 to 107 bytes (the kernel's limit for a Unix socket)";
}

// The kernel's names of lines have at most 31 bytes, its labels of chips as well; a path to a chip is short, too.
std::string check_gpio_name(std::string_view v) {
  const auto good = [](unsigned char c) { return c >= 0x20 && c < 0x7f; };
  return v.size() <= 64 && std::all_of(v.begin(), v.end(), good) ? "" : "must have at most 64 printable characters, as `boothctl doctor` prints them";
}

std::string check_path(std::string_view v) { return v.empty() ? "must not be empty" : ""; }

std::string check_serial(std::string_view v) {
  const auto good = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); };
  return !v.empty() && v.size() <= 64 && std::all_of(v.begin(), v.end(), good) ? "" : "must be 1 to 64 letters and digits, as `boothctl doctor` prints them";
}

bool is_number(std::string_view v) {
  return !v.empty() && v.size() < 6 && std::all_of(v.begin(), v.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::string check_body(std::string_view v) {
  return v == "men" || v == "women" || (v.starts_with("test:") && is_number(v.substr(5))) ? "" : "must be \"men\", \"women\" or \"test:N\"";
}

std::string check_noise(std::string_view v) {
  if (v == "none" || v == "kinect2") return "";
  if (v.starts_with("gaussian:")) {
    try {
      std::size_t used = 0;
      const std::string number(v.substr(9));
      const double sigma = std::stod(number, &used);
      if (used == number.size() && sigma >= 0 && sigma <= 1) return "";
    } catch (const std::exception&) {
    }
  }
  return "must be \"none\", \"kinect2\" or \"gaussian:SIGMA\" with SIGMA from 0 to 1 (metres)";
}

// XML goes to the DDS library with this text inside: names of interfaces and hosts need no other characters.
std::string check_host(std::string_view v) {
  const auto good = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.' || c == ':' || c == '%';
  };
  return v.size() <= 255 && std::all_of(v.begin(), v.end(), good) ? "" : "must consist of letters, digits and '-', '_', '.', ':', '%'";
}

#ifdef BOOTHD_EMULATOR
const std::vector<std::string_view> kDrivers{"synthetic", "recording", "kinect2", "kinect2-emulated"}, kAbsentDrivers{};
#else
const std::vector<std::string_view> kDrivers{"synthetic", "recording", "kinect2"}, kAbsentDrivers{"kinect2-emulated"};
#endif

#if defined(BOOTHD_HAS_CUDA)
const std::vector<std::string_view> kProcessors{"auto", "cpu", "cuda"}, kAbsentProcessors{};
#else
const std::vector<std::string_view> kProcessors{"auto", "cpu"}, kAbsentProcessors{"cuda"};
#endif

#define BOOTH_SLOT(member) [](Config& c) -> ConfigSlot { return &c.member; }

const std::vector<ConfigKey>& table() {
  static const std::vector<ConfigKey> keys{
      {.name = "booth.id", .slot = BOOTH_SLOT(booth.id), .doc = "Name of this booth: the DDS partition and the key of every sample.", .check = check_id},
      {.name = "control.socket",
       .slot = BOOTH_SLOT(control.socket),
       .doc = "Unix socket on which boothctl talks to boothd; $RUNTIME_DIRECTORY/control.sock where systemd sets that variable.",
       .check = check_socket},
      {.name = "cameras.driver",
       .slot = BOOTH_SLOT(cameras.driver),
       .doc =
           "Where depth comes from: Kinect v2 sensors, a simulated booth, a recording, or the Kinect v2 driver with emulated sensors in the simulated booth.",
       .choices = kDrivers,
       .absent = kAbsentDrivers},
      {.name = "cameras.minimum", .slot = BOOTH_SLOT(cameras.minimum), .doc = "With fewer cameras delivering, the fit pauses.", .minimum = 1, .maximum = 8},
      {.name = "cameras.board",
       .slot = BOOTH_SLOT(cameras.board),
       .doc = "Paper of the printed calibration board that a calibration by boothd itself is shown.",
       .choices = {"a4", "a3", "a2", "a1", "a0"}},
      {.name = "cameras.board_square_mm",
       .slot = BOOTH_SLOT(cameras.board_square_mm),
       .doc = "What a square of it measures where the print came out differently, in millimetres; 0: what it should.",
       .minimum = 0,
       .maximum = 500},
      {.name = "cameras.kinect2.serials",
       .slot = BOOTH_SLOT(cameras.kinect2.serials),
       .doc = "Serials of the sensors, one for each position: those of the calibration file in its order, without one the corners of the default booth.",
       .check = check_serial},
      {.name = "cameras.kinect2.calibration",
       .slot = BOOTH_SLOT(cameras.kinect2.calibration),
       .doc =
           "The calibration.toml that says where the cameras stand, and that a calibration replaces; $STATE_DIRECTORY/calibration.toml where systemd sets that "
           "variable. Where it is not there yet, the cameras are taken to stand at the corners of a 4 m square, 1.6 m high, aimed at (0, 0, 0.95)."},
      {.name = "cameras.kinect2.cache",
       .slot = BOOTH_SLOT(cameras.kinect2.cache),
       .doc = "Folder for what was once read from each sensor (lens and phase tables); $STATE_DIRECTORY/kinect2 where systemd sets that variable.",
       .check = check_path},
      {.name = "cameras.kinect2.transfers",
       .slot = BOOTH_SLOT(cameras.kinect2.transfers),
       .doc = "Infrared transfers in flight for each sensor, one millisecond and 270 kB of usbfs memory each.",
       .minimum = 8,
       .maximum = 120},
      {.name = "cameras.kinect2.colour", .slot = BOOTH_SLOT(cameras.kinect2.colour), .doc = "Receive the colour stream too; nothing uses it yet."},
      {.name = "cameras.kinect2.decoder",
       .slot = BOOTH_SLOT(cameras.kinect2.decoder),
       .doc =
           "What makes depth of the sensors' signals: `cuda` a CUDA device, with the CPU to take over when it fails; `auto` the same where the build has CUDA.",
       .choices = kProcessors,
       .absent = kAbsentProcessors},
      {.name = "cameras.emulated.rate",
       .slot = BOOTH_SLOT(cameras.emulated.rate),
       .doc = "Frames per second of each emulated sensor; the person and the room are those of cameras.synthetic.",
       .minimum = 1,
       .maximum = 30},
      {.name = "cameras.recording.path", .slot = BOOTH_SLOT(cameras.recording.path), .doc = "The recording that the driver `recording` plays."},
      {.name = "cameras.recording.pace",
       .slot = BOOTH_SLOT(cameras.recording.pace),
       .doc = "Play at the recording's own pace, or as fast as it can be read.",
       .choices = {"own", "fast"}},
      {.name = "cameras.synthetic.body", .slot = BOOTH_SLOT(cameras.synthetic.body), .doc = "Who stands in the simulated booth.", .check = check_body},
      {.name = "cameras.synthetic.motion",
       .slot = BOOTH_SLOT(cameras.synthetic.motion),
       .doc = "What the simulated person does.",
       .choices = {"a-pose", "walk", "turn", "wave", "kick", "squat", "roll-hands", "jump", "left-arm", "showcase"}},
      {.name = "cameras.synthetic.noise", .slot = BOOTH_SLOT(cameras.synthetic.noise), .doc = "Noise of the simulated depth.", .check = check_noise},
      {.name = "cameras.synthetic.count", .slot = BOOTH_SLOT(cameras.synthetic.count), .doc = "Number of simulated cameras.", .minimum = 1, .maximum = 8},
      {.name = "cameras.synthetic.seed", .slot = BOOTH_SLOT(cameras.synthetic.seed), .doc = "Seed of the simulated noise.", .minimum = 0, .maximum = 9e15},
      {.name = "cameras.synthetic.seconds",
       .slot = BOOTH_SLOT(cameras.synthetic.seconds),
       .doc = "Length of the built-in motion before it begins again, seconds.",
       .minimum = 1,
       .maximum = 3600},
      {.name = "models.directory",
       .slot = BOOTH_SLOT(models.directory),
       .doc = "Folder with men.npz, women.npz and pose.npz; empty: $BOOTHD_MODELS, then the installed models, then those of the source tree."},
      {.name = "stage.radius",
       .slot = BOOTH_SLOT(stage.radius),
       .doc = "Radius of the cylinder in which a person is looked for, metres.",
       .minimum = 0.5,
       .maximum = 5},
      {.name = "stage.height", .slot = BOOTH_SLOT(stage.height), .doc = "Height of that cylinder above the floor, metres.", .minimum = 1, .maximum = 4},
      {.name = "stage.centre_x",
       .slot = BOOTH_SLOT(stage.centre_x),
       .doc = "Centre of the cylinder, x forward, booth frame, metres.",
       .minimum = -10,
       .maximum = 10},
      {.name = "stage.centre_y",
       .slot = BOOTH_SLOT(stage.centre_y),
       .doc = "Centre of the cylinder, y left, booth frame, metres.",
       .minimum = -10,
       .maximum = 10},
      {.name = "fit.preset",
       .slot = BOOTH_SLOT(fit.preset),
       .doc = "`booth` is the daemon's own estimator, `paper` the published particle swarm.",
       .choices = {"booth", "paper"}},
      {.name = "fit.backend",
       .slot = BOOTH_SLOT(fit.backend),
       .doc = "What computes preset paper's swarm: `cuda` a CUDA device, with the CPU to take over when it fails; `auto` the same where the build has CUDA. "
              "Preset "
              "booth works on the CPU.",
       .choices = kProcessors,
       .absent = kAbsentProcessors},
      {.name = "fit.particles",
       .slot = BOOTH_SLOT(fit.particles),
       .doc = "Particles of preset paper's swarm, also on the CPU; 0: 2,000, as published, and 5,000 on a device (docs/guide/gpu.md has the curve of error "
              "against "
              "them).",
       .minimum = 0,
       .maximum = 100000},
      {.name = "fit.sex",
       .slot = BOOTH_SLOT(fit.sex),
       .doc = "Which body model to fit; `auto` fits both and keeps the better.",
       .choices = {"auto", "men", "women"}},
      {.name = "fit.threads",
       .slot = BOOTH_SLOT(fit.threads),
       .doc = "Worker threads of the fit; the result does not depend on it.",
       .minimum = 1,
       .maximum = 64},
      {.name = "fit.seed", .slot = BOOTH_SLOT(fit.seed), .doc = "Seed of the fit's random numbers.", .minimum = 0, .maximum = 9e15},
      {.name = "session.directory",
       .slot = BOOTH_SLOT(session.directory),
       .doc = "Folder of the session folders; $STATE_DIRECTORY/sessions where systemd sets that variable.",
       .check = check_path},
      {.name = "session.quota_bytes",
       .slot = BOOTH_SLOT(session.quota_bytes),
       .doc = "Oldest sessions are deleted until all of them take at most this many bytes; 0: no limit.",
       .minimum = 0,
       .maximum = 9e15},
      {.name = "session.max_age_days",
       .slot = BOOTH_SLOT(session.max_age_days),
       .doc = "Sessions older than this many days are deleted; 0: no limit.",
       .minimum = 0,
       .maximum = 36500},
      {.name = "session.max_seconds",
       .slot = BOOTH_SLOT(session.max_seconds),
       .doc = "A session ends by itself after this many seconds.",
       .minimum = 1,
       .maximum = 14400},  // its frames are in memory while its files are written: 1.6 GB of boothd.slice's 3
      {.name = "session.search_seconds",
       .slot = BOOTH_SLOT(session.search_seconds),
       .doc = "A session ends by itself when the person has been lost for this many seconds.",
       .minimum = 1,
       .maximum = 86400},
      {.name = "session.lost_seconds",
       .slot = BOOTH_SLOT(session.lost_seconds),
       .doc = "The state changes to searching when no frame has shown the person for this many seconds.",
       .minimum = 0.05,
       .maximum = 60},
      {.name = "session.estimate_seconds",
       .slot = BOOTH_SLOT(session.estimate_seconds),
       .doc = "A session ends by itself when somebody has been there for this many seconds and no body was found.",
       .minimum = 1,
       .maximum = 86400},
      {.name = "session.pause_seconds",
       .slot = BOOTH_SLOT(session.pause_seconds),
       .doc = "A session ends by itself when there have been too few cameras for this many seconds.",
       .minimum = 1,
       .maximum = 86400},
      {.name = "session.countdown_seconds",
       .slot = BOOTH_SLOT(session.countdown_seconds),
       .doc = "From the press to the session's beginning: time to step onto the stage. 0: at once.",
       .minimum = 0,
       .maximum = 60},
      {.name = "gpio.chip",
       .slot = BOOTH_SLOT(gpio.chip),
       .doc = "Label, name or path of the GPIO chip with button and light; empty: none; `simulated`: one inside boothd, pressed by `boothctl press`.",
       .check = check_gpio_name},
      {.name = "gpio.start",
       .slot = BOOTH_SLOT(gpio.start),
       .doc = "Line (name or offset) of the start button; without gpio.stop it stops, too.",
       .check = check_gpio_name},
      {.name = "gpio.stop", .slot = BOOTH_SLOT(gpio.stop), .doc = "Line of the stop button; empty: none.", .check = check_gpio_name},
      {.name = "gpio.emergency_stop",
       .slot = BOOTH_SLOT(gpio.emergency_stop),
       .doc = "Line of the emergency stop; empty: none. A line that cannot be read counts as pressed.",
       .check = check_gpio_name},
      {.name = "gpio.light", .slot = BOOTH_SLOT(gpio.light), .doc = "Line of the status light; empty: none.", .check = check_gpio_name},
      {.name = "gpio.buzzer", .slot = BOOTH_SLOT(gpio.buzzer), .doc = "Line of the buzzer; empty: none.", .check = check_gpio_name},
      {.name = "gpio.active_low", .slot = BOOTH_SLOT(gpio.active_low), .doc = "A pressed start or stop button pulls its line to ground."},
      {.name = "gpio.emergency_stop_active_low",
       .slot = BOOTH_SLOT(gpio.emergency_stop_active_low),
       .doc = "A pressed emergency stop pulls its line to ground; false for the usual contact that opens, so that a cut wire is a stop."},
      {.name = "gpio.light_active_low", .slot = BOOTH_SLOT(gpio.light_active_low), .doc = "Light and buzzer are on when their lines are low."},
      {.name = "gpio.bias",
       .slot = BOOTH_SLOT(gpio.bias),
       .doc = "Resistor that the chip puts on the lines of buttons and emergency stop.",
       .choices = {"as-is", "disabled", "pull-up", "pull-down"}},
      {.name = "gpio.debounce_ms",
       .slot = BOOTH_SLOT(gpio.debounce_ms),
       .doc = "A button counts as pressed or released when its line has been quiet for this many milliseconds.",
       .minimum = 0,
       .maximum = 1000},
      {.name = "gpio.long_press_seconds",
       .slot = BOOTH_SLOT(gpio.long_press_seconds),
       .doc =
           "A start button that is pressed for this many seconds asks for a calibration instead, and a shorter press counts when it is let go. 0: presses of "
           "any length are the same, and count at once.",
       .minimum = 0,
       .maximum = 60},
      {.name = "gpio.stuck_seconds",
       .slot = BOOTH_SLOT(gpio.stuck_seconds),
       .doc = "A start or stop button that has been pressed for this many seconds is shown as stuck.",
       .minimum = 1,
       .maximum = 3600},
      {.name = "record.depth",
       .slot = BOOTH_SLOT(record.depth),
       .doc = "Depth images, which are personal data, may be kept in memory and written by `boothctl record --depth`, `boothctl snapshot` and on a fault; "
              "without it none ever reaches a disk."},
      {.name = "record.directory",
       .slot = BOOTH_SLOT(record.directory),
       .doc = "Folder of the recordings; $STATE_DIRECTORY/recordings where systemd sets that variable.",
       .check = check_path},
      {.name = "record.memory_seconds",
       .slot = BOOTH_SLOT(record.memory_seconds),
       .doc = "How many of the last seconds are always in memory, for snapshots.",
       .minimum = 1,
       .maximum = 600},
      {.name = "record.memory_bytes",
       .slot = BOOTH_SLOT(record.memory_bytes),
       .doc = "Memory for them; what does not fit is the oldest. Taken at the start where record.depth is true, else 4 MiB are.",
       .minimum = 1 << 20,
       .maximum = 64e9},
      {.name = "record.on_fault", .slot = BOOTH_SLOT(record.on_fault), .doc = "Write a snapshot when a fault is reported, at most one in ten minutes."},
      {.name = "record.keep_free_bytes",
       .slot = BOOTH_SLOT(record.keep_free_bytes),
       .doc = "A recording ends when its disk has less than this left: sessions come first.",
       .minimum = 0,
       .maximum = 9e15},
      {.name = "record.quota_bytes",
       .slot = BOOTH_SLOT(record.quota_bytes),
       .doc = "Oldest recordings are deleted until all of them take at most this many bytes; 0: no limit.",
       .minimum = 0,
       .maximum = 9e15},
      {.name = "record.max_age_days",
       .slot = BOOTH_SLOT(record.max_age_days),
       .doc = "Recordings older than this many days are deleted; 0: no limit.",
       .minimum = 0,
       .maximum = 36500},
      {.name = "privacy.seal_to",
       .slot = BOOTH_SLOT(privacy.seal_to),
       .doc =
           "File with the public key (`boothctl key new`) to which sessions and recordings are sealed, so that this booth cannot read them again; empty: they "
           "are not sealed."},
      {.name = "dds.enabled", .slot = BOOTH_SLOT(dds.enabled), .doc = "Publish on DDS at all."},
      {.name = "dds.domain", .slot = BOOTH_SLOT(dds.domain), .doc = "DDS domain.", .minimum = 0, .maximum = 232},
      {.name = "dds.interface",
       .slot = BOOTH_SLOT(dds.interface),
       .doc = "Network interface (or its address) that DDS uses; empty: the library chooses.",
       .check = check_host},
      {.name = "dds.multicast",
       .slot = BOOTH_SLOT(dds.multicast),
       .doc = "Find others and send to them by multicast; without it dds.peers names the machines, this one always among them."},
      {.name = "dds.peers", .slot = BOOTH_SLOT(dds.peers), .doc = "Machines with which to talk when they cannot be found by multicast.", .check = check_host},
      {.name = "dds.security",
       .slot = BOOTH_SLOT(dds.security),
       .doc = "DDS Security: with `on` nobody hears or commands this booth without credentials of its fleet, and boothd does not start without its own.",
       .choices = {"off", "on"}},
      {.name = "dds.credentials",
       .slot = BOOTH_SLOT(dds.credentials),
       .doc = "Folder from `boothctl security issue`; empty: what systemd delivers (boothd.cert.pem ...), and where it delivers nothing, self-issued ones."},
      {.name = "dds.self_issued",
       .slot = BOOTH_SLOT(dds.self_issued),
       .doc = "Folder of the fleet of one that boothd makes where it was given no credentials; $STATE_DIRECTORY/security where systemd sets that variable.",
       .check = check_path},
      {.name = "dds.expiry_warning_days",
       .slot = BOOTH_SLOT(dds.expiry_warning_days),
       .doc = "So many days before its credentials expire boothd begins to complain.",
       .minimum = 0,
       .maximum = 3650},
      {.name = "dds.ros2",
       .slot = BOOTH_SLOT(dds.ros2),
       .doc = "Mirror skeleton, cloud and cameras' places as ROS 2 topics (docs/reference/ros2.md); dds.domain is ROS_DOMAIN_ID."},
      {.name = "dds.ros2_namespace",
       .slot = BOOTH_SLOT(dds.ros2_namespace),
       .doc = "ROS 2 namespace before /humans; needed where several booths are in one domain.",
       .check = ros_namespace_problem},
      {.name = "log.level",
       .slot = BOOTH_SLOT(log.level),
       .doc = "The least important messages that are logged.",
       .choices = {"error", "warning", "info", "debug"}},
      {.name = "hardening.system_calls",
       .slot = BOOTH_SLOT(hardening.system_calls),
       .doc = "What boothd may ask of the kernel once it is ready: `narrow`, a measured list; `all`, what its unit allows, for a library or driver that needs "
              "more "
              "than was measured. With a CUDA device `narrow` is `all`.",
       .choices = {"narrow", "all"}},
  };
  return keys;
}
#undef BOOTH_SLOT

std::string join_quoted(const auto& list, std::string_view separator) {
  std::string out;
  for (const auto& item : list) out += (out.empty() ? "" : std::string(separator)) + toml_string(item);
  return out;
}

std::string number(double v) { return std::abs(v) < 9.1e15 && v == std::floor(v) ? fmt::format("{}", static_cast<std::int64_t>(v)) : fmt::format("{}", v); }

}  // namespace

std::span<const ConfigKey> config_keys() { return table(); }

const ConfigKey* find_config_key(std::string_view name) {
  const auto keys = config_keys();
  const auto it = std::find_if(keys.begin(), keys.end(), [&](const ConfigKey& k) { return k.name == name; });
  return it == keys.end() ? nullptr : &*it;
}

std::string_view nearest_config_key(std::string_view name) {
  std::string_view best;
  std::size_t best_distance = misspelling_limit(name) + 1;
  for (const ConfigKey& key : config_keys()) {
    std::size_t d = edit_distance(name, key.name);
    // The right key in the wrong table is as near as a spelling mistake.
    const auto last = [](std::string_view n) { return n.substr(n.rfind('.') == std::string_view::npos ? 0 : n.rfind('.') + 1); };
    if (last(name) == last(key.name)) d = std::min<std::size_t>(d, 2);
    if (d < best_distance) {
      best_distance = d;
      best = key.name;
    }
  }
  return best;
}

std::string allowed_values(const ConfigKey& key) {
  Config scratch;
  const auto range = [&](std::string_view what) {
    return std::isfinite(key.minimum) ? fmt::format("{} from {} to {}", what, number(key.minimum), number(key.maximum)) : std::string(what);
  };
  return std::visit(Overload{
                        [&](bool*) { return std::string(key.absent.empty() ? "true or false" : "false"); },
                        [&](std::int64_t*) { return range("a whole number"); },
                        [&](double*) { return range("a number"); },
                        [&](std::string*) {
                          if (key.choices.empty()) return std::string("a text");
                          return key.choices.size() == 1 ? join_quoted(key.choices, "") : "one of " + join_quoted(key.choices, ", ");
                        },
                        [&](std::vector<std::string>*) { return std::string("a list of texts"); },
                    },
                    key.slot(scratch));
}

std::string format_config_value(const ConfigKey& key, const Config& config) {
  Config copy = config;
  return std::visit(Overload{
                        [](bool* v) { return std::string(*v ? "true" : "false"); },
                        [](std::int64_t* v) { return fmt::format("{}", *v); },
                        [](double* v) { return fmt::format("{}", *v); },
                        [](std::string* v) { return toml_string(*v); },
                        [](std::vector<std::string>* v) { return "[" + join_quoted(*v, ", ") + "]"; },
                    },
                    key.slot(copy));
}

}  // namespace booth::daemon
