// Which sensor stands where, and what all of them share.
#include "daemon/drivers_factory.kinect2.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>

#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/drivers_factory.usb.hpp"
#include "daemon/health/log.hpp"
#include "daemon/health/messages.hpp"
#include "daemon/health/repeated_log.hpp"
#include "drivers/kinect2/decoder/guarded_decoder.hpp"
#include "drivers/kinect2/kinect_camera.hpp"
#include "drivers/kinect2/kinect_device.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/pacing/punctual_camera.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/usb/libusb_bus.hpp"
#include "drivers/usb/power_control.hpp"
#include "drivers/usb/recover_request.hpp"
#ifdef BOOTHD_EMULATOR
#include "drivers/kinect2/emulator/scene_view.hpp"
#endif

namespace booth::daemon {
namespace {

namespace kinect2 = drivers::kinect2;

struct Position {
  std::string name, serial;
  hal::RigidTransform camera_to_world;
  double depth_gain = 0, depth_offset = 0;
  double late = 0;  ///< seconds
};

std::string found_serials(drivers::usb::Bus& bus) {
  std::vector<std::string> serials;
  for (const auto& device : bus.list(kinect2::kDeviceIds)) {
    const std::string serial = kinect2::clean_serial(device.serial);
    serials.push_back(serial.empty() ? "one without a readable serial" : serial);
  }
  return serials.empty() ? "none is plugged in" : fmt::format("plugged in are {}", fmt::join(serials, ", "));
}

/// What the calibration file says of the sensors, which may lack serials.
struct Stored {
  std::vector<Position> where;
  CalibrationUsed used;
};

Position position_of(const hal::CameraDescription& place) {
  return {
      .name = place.name, .serial = place.serial, .camera_to_world = place.camera_to_world, .depth_gain = place.depth_gain, .depth_offset = place.depth_offset};
}

/// Nothing where there is no file yet.
std::optional<Stored> read_stored(const std::string& file) {
  std::error_code unreadable;
  if (file.empty() || !(std::filesystem::exists(file, unreadable) || unreadable)) return std::nullopt;
  drivers::CalibrationNotes said;
  Stored out;
  for (const auto& place : drivers::read_calibration(file, &said)) out.where.push_back(position_of(place));
  const auto late = drivers::read_time_offsets(file);
  for (std::size_t i = 0; i < out.where.size(); ++i) out.where[i].late = late[i];
  out.used = calibration_used(file, said, true);
  for (const auto& warning : said.newer) log_message(LogLevel::warning, Message::newer_file, warning);
  if (said.checksum.empty())
    log_line(LogLevel::info, file +
                                 " has no checksum: it was edited, or an older boothd wrote it. A byte that changes in it is not noticed; when it is as it "
                                 "should be, boothctl calibrate --confirm gives it one");
  return out;
}

/// `used` says where they are from.
std::vector<Position> positions(const Config& config, drivers::usb::Bus& bus, CalibrationUsed& used) {
  const auto& kinect = config.cameras.kinect2;
  const auto nobody_named = [&] {
    return std::runtime_error("cameras.kinect2.serials is empty: name the sensors in the order of their positions (" + found_serials(bus) + ")");
  };
  std::optional<Stored> stored = read_stored(kinect.calibration);
  const bool calibrated = stored.has_value();
  if (!calibrated) {
    if (kinect.serials.empty()) throw nobody_named();
    stored = {.where = {}, .used = {.source = CalibrationUsed::Source::layout}};
    for (const auto& place : drivers::camera_ring(static_cast<int>(kinect.serials.size()))) stored->where.push_back(position_of(place));
  }
  std::vector<Position>& places = stored->where;
  used = stored->used;
  if (kinect.serials.empty() && std::any_of(places.begin(), places.end(), [](const auto& p) { return p.serial.empty(); })) throw nobody_named();
  if (!calibrated)
    log_line(LogLevel::warning, fmt::format("{}the cameras are taken to stand at the corners of the default booth: calibrate them (boothctl calibrate)",
                                            kinect.calibration.empty() ? "" : kinect.calibration + " is not there yet: "));
  if (!kinect.serials.empty() && places.size() != kinect.serials.size())
    throw std::runtime_error(
        fmt::format("cameras.kinect2.serials names {} sensors, {} has {} positions", kinect.serials.size(), kinect.calibration, places.size()));
  for (std::size_t i = 0; i < kinect.serials.size(); ++i) places[i].serial = kinect.serials[i];
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (places[i].serial == places[j].serial) throw std::runtime_error("cameras.kinect2.serials names " + places[i].serial + " twice");
  return places;
}

bool decodes_on_device(const Config& config) {
  const std::string& decoder = config.cameras.kinect2.decoder;
#if defined(BOOTHD_HAS_CUDA)
  return decoder != "cpu";
#else
  return decoder == "cuda";
#endif
}

kinect2::DecoderMaker decoder_maker(const Config& config) {
  if (!decodes_on_device(config)) return {};
  return [](const auto& camera, const auto& phase, const auto& settings) { return kinect2::make_guarded_decoder(camera, phase, settings); };
}

/// Each line once in ten minutes: a sensor that dies every few seconds tells its firmware each time.
kinect2::Notes notes(std::shared_ptr<hal::Clock> clock) {
  return [log = std::make_shared<RepeatedLog>(), clock = std::move(clock)](kinect2::Gravity gravity, const std::string& sentence) {
    log->say(gravity == kinect2::Gravity::warning ? LogLevel::warning : LogLevel::info, sentence, clock->now());
  };
}

hal::DepthCameras make_cameras(const Config& config, const kinect2::KinectShared& shared, const std::vector<Position>& positions, double rate = 30) {
  const auto& kinect = config.cameras.kinect2;
  kinect2::Patience patience;
  patience.stall = std::max<hal::Nanoseconds>(patience.stall, hal::from_seconds(9 / rate));  // an emulated sensor may be slow
  hal::DepthCameras cameras;
  for (const Position& position : positions)
    cameras.push_back(drivers::punctual(kinect2::make_kinect_camera(shared, {.index = hal::CameraIndex(static_cast<std::uint8_t>(cameras.size())),
                                                                             .serial = position.serial,
                                                                             .name = position.name,
                                                                             .camera_to_world = position.camera_to_world,
                                                                             .depth_gain = position.depth_gain,
                                                                             .depth_offset = position.depth_offset,
                                                                             .transfers = static_cast<int>(kinect.transfers),
                                                                             .colour = kinect.colour,
                                                                             .nominal_rate = rate,
                                                                             .patience = patience}),
                                        hal::from_seconds(position.late)));
  return cameras;
}

/// Where the installation has somebody with more rights to ask (systemd/boothd-usb-recover@.service).
std::shared_ptr<drivers::usb::RecoverClient> recover_client() {
  const char* requests = std::getenv("BOOTHD_USB_REQUESTS");
  const char* answers = std::getenv("BOOTHD_USB_ANSWERS");
  if (requests == nullptr || *requests == '\0' || answers == nullptr || *answers == '\0') return nullptr;
  return std::make_shared<drivers::usb::RecoverClient>(requests, answers);
}

/// Before the first sensor is opened: with too little memory for all of them each would refuse.
void want_usbfs_memory(const Config& config, std::size_t sensors, drivers::usb::RecoverClient* root) {
  const auto limit = open_usb_topology()->read().usbfs_memory_mb;
  const double needed = static_cast<double>(sensors) * usbfs_bytes(config) / 1048576.0;
  if (!limit || *limit == 0 || *limit >= needed || root == nullptr) return;
  constexpr int kEnough = 256;
  const auto outcome = root->ask(drivers::usb::RecoverStep::usbfs_memory, std::to_string(std::max(kEnough, static_cast<int>(std::ceil(needed)))));
  log_line(outcome ? LogLevel::info : LogLevel::warning, outcome.sentence);
}

/// The ladder's upper rungs. What was done or went wrong is logged each time; what is not permitted or not sensible, once.
kinect2::PowerTools power_tools(std::shared_ptr<drivers::usb::RecoverClient> root) {
  struct Said {
    std::mutex mutex;
    std::set<std::string> before;
  };
  const auto power = std::make_shared<drivers::usb::PowerControl>(is_sensor);
  const auto said = std::make_shared<Said>();
  const auto report = [said](const drivers::usb::PowerOutcome& outcome) {
    using Result = drivers::usb::PowerOutcome::Result;
    const bool quiet = outcome.result == Result::not_permitted || outcome.result == Result::refused;
    const std::lock_guard lock(said->mutex);
    if (!quiet || (said->before.size() < 64 && said->before.insert(outcome.sentence).second))
      log_line(quiet ? LogLevel::info : LogLevel::warning, outcome.sentence);
    return static_cast<bool>(outcome);
  };
  // What this process may not do itself, it asks for.
  using drivers::usb::RecoverStep;
  const auto or_ask = [root = std::move(root)](drivers::usb::PowerOutcome outcome, RecoverStep step, const std::string& argument) {
    if (outcome.result != drivers::usb::PowerOutcome::Result::not_permitted || !root || argument.empty()) return outcome;
    return root->ask(step, argument);
  };
  return {.reset_port = [power, report, or_ask](const std::string& path) { return report(or_ask(power->reset_port(path), RecoverStep::port, path)); },
          .rebind_controller =
              [power, report, or_ask](const std::string& path) {
                return report(or_ask(power->rebind_controller(path), RecoverStep::controller, power->controller_of(path)));
              }};
}

}  // namespace

DecodeBytes decode_memory(const Config& config, std::size_t cameras) {
  const std::string& driver = config.cameras.driver;
  if (!decodes_on_device(config) || (driver != "kinect2" && driver != "kinect2-emulated")) return {};
  const gpu::DeviceBytes one = kinect2::guarded_decoder_bytes();
  return {.device = cameras * one.device, .pinned = cameras * one.pinned};
}

DepthSource open_kinect(const Config& config, std::shared_ptr<hal::Clock> clock) {
  const auto root = recover_client();
  kinect2::KinectShared shared{
      .bus = drivers::usb::make_libusb_bus([](bool error, const std::string& text) { log_line(error ? LogLevel::warning : LogLevel::info, text); }),
      .clock = clock,
      .cache = std::make_shared<kinect2::CalibrationCache>(config.cameras.kinect2.cache),
      .power = power_tools(root),
      .notes = notes(clock),
      .decoder = decoder_maker(config)};
  CalibrationUsed calibration;
  const auto where = positions(config, *shared.bus, calibration);
  want_usbfs_memory(config, where.size(), root.get());
  return {.clock = clock,
          .cameras = make_cameras(config, shared, where),
          .truth = nullptr,
          .background = {},
          .name = fmt::format("kinect2: {} sensors", where.size()),
          .calibration = std::move(calibration)};
}

#ifdef BOOTHD_EMULATOR
namespace {

/// Emulated sensors hang where the scene has them, and are taken to hang where the stored calibration has them, as real ones are. One of other sensors says
/// nothing of them: whoever tries the emulator on a booth's own box need not put its calibration away.
std::vector<Position> emulated_positions(const Config& config, const std::vector<hal::CameraDescription>& scene, CalibrationUsed& used) {
  std::vector<Position> out;
  for (const auto& camera : scene) out.push_back(position_of(camera));
  used = {.source = CalibrationUsed::Source::layout};
  const std::string& file = config.cameras.kinect2.calibration;
  std::optional<Stored> stored = read_stored(file);
  if (!stored) return out;
  std::vector<Position> calibrated;
  for (const Position& sensor : out)
    for (const Position& place : stored->where)
      if (place.serial == sensor.serial) calibrated.push_back(place);
  if (calibrated.size() != out.size() || stored->where.size() != out.size()) {
    log_line(LogLevel::warning, fmt::format("{} is of other sensors: the emulated ones are taken to stand where the simulated booth has them", file));
    return out;
  }
  used = std::move(stored->used);
  return calibrated;
}

}  // namespace

DepthSource open_emulated_kinect(const Config& config, drivers::Person person, std::shared_ptr<hal::Clock> clock) {
  const auto& synthetic = config.cameras.synthetic;
  drivers::SceneSettings scene;
  scene.cameras = drivers::camera_ring(static_cast<int>(synthetic.count));
  scene.noise = drivers::NoiseModel::parse(synthetic.noise);
  scene.seed = static_cast<std::uint64_t>(synthetic.seed);
  std::vector<drivers::Person> persons;
  persons.push_back(std::move(person));
  auto emulated = kinect2::emulator::make_emulated_scene(std::move(scene), std::move(persons), config.cameras.emulated.rate, clock);
  CalibrationUsed calibration;
  const auto where = emulated_positions(config, emulated.cameras, calibration);
  const kinect2::KinectShared shared{.bus = emulated.bus, .clock = clock, .notes = notes(clock), .decoder = decoder_maker(config)};
  return {.clock = clock,
          .cameras = make_cameras(config, shared, where, config.cameras.emulated.rate),
          .truth = std::move(emulated.truth),
          .background = std::move(emulated.background),
          .name = fmt::format("kinect2-emulated: {} {} noise {} seed {}", synthetic.body, synthetic.motion, synthetic.noise, synthetic.seed),
          .calibration = std::move(calibration)};
}
#endif

}  // namespace booth::daemon
