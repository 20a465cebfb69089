// Constructs drivers; nothing else in the daemon includes them.
#include "daemon/drivers_factory.hpp"

#include <fmt/format.h>

#include <limits>
#include <stdexcept>

#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/drivers_factory.kinect2.hpp"
#include "daemon/io/model_file.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/truth_surface.hpp"

namespace booth::daemon {
namespace {

DepthSource wrap(drivers::Source source, std::shared_ptr<hal::Clock> clock, std::string name, CalibrationUsed calibration) {
  return {.clock = std::move(clock),
          .cameras = std::move(source.cameras),
          .truth = std::move(source.truth),
          .background = std::move(source.background),
          .name = std::move(name),
          .live_groups = std::move(source.live.groups),
          .to_live = source.live.to_live,
          .calibration = std::move(calibration)};
}

/// Of a recording: the file in its folder, which a bag of another program may lack.
CalibrationUsed recorded_calibration(const std::filesystem::path& recording) {
  const std::filesystem::path file = recording / "calibration.toml";
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return {};
  drivers::CalibrationNotes notes;
  (void)drivers::read_calibration(file, &notes);
  return calibration_used(file, notes, false);
}

DepthSource open_recorded(const std::filesystem::path& path, drivers::Pace pace, std::shared_ptr<hal::Clock> clock) {
  drivers::Source source = drivers::open_recording(path, pace, clock, drivers::truth_surface);
  return wrap(std::move(source), std::move(clock), "recording: " + path.string(), recorded_calibration(path));
}

/// `name` is "test:N". The complaint names the key: the file may be right and have no such body.
TestBody test_body(const std::filesystem::path& file, const std::string& name) {
  try {
    return load_test_body(file, std::stoi(name.substr(5)));
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("cameras.synthetic.body \"{}\": {}", name, e.what()));
  }
}

drivers::Person make_scene_person(const Config& config) {
  const auto& synthetic = config.cameras.synthetic;
  const auto directory = find_models(config.models.directory);
  const auto model_of = [&](fit::Sex sex) {
    return std::make_shared<const fit::BodyModel>(load_body_model(directory / (std::string(to_string(sex)) + ".npz")));
  };
  if (!synthetic.body.starts_with("test:")) {
    auto model = model_of(synthetic.body == "women" ? fit::Sex::women : fit::Sex::men);
    fit::Vertices rest;
    const fit::ShapeVector beta = fit::ShapeVector::Zero(model->shape_count());
    model->shaped(beta, rest);
    auto motion = drivers::motion_by_name(synthetic.motion, synthetic.seconds, drivers::contact_of(*model, rest, model->rest_joints(beta)));
    return drivers::make_person(synthetic.body, std::move(model), beta, std::move(motion));
  }
  TestBody body = test_body(directory / "test_bodies.npz", synthetic.body);
  auto model = model_of(body.sex);
  auto motion = drivers::motion_by_name(synthetic.motion, synthetic.seconds, drivers::contact_of(*model, body.rest, body.rest_joints));
  return drivers::make_person(synthetic.body, std::move(model), std::move(body.rest), body.rest_joints, std::move(motion));
}

DepthSource open_synthetic(const Config& config, drivers::Pace pace, double seconds, std::shared_ptr<hal::Clock> clock) {
  const auto& synthetic = config.cameras.synthetic;
  drivers::SceneSettings scene;
  scene.cameras = drivers::camera_ring(static_cast<int>(synthetic.count));
  scene.noise = drivers::NoiseModel::parse(synthetic.noise);
  scene.seed = static_cast<std::uint64_t>(synthetic.seed);
  scene.pace = pace;
  scene.seconds = seconds;
  std::vector<drivers::Person> persons;
  persons.push_back(make_scene_person(config));
  return wrap(drivers::make_scene(std::move(scene), std::move(persons), clock), clock,
              fmt::format("synthetic: {} {} noise {} seed {}", synthetic.body, synthetic.motion, synthetic.noise, synthetic.seed),
              {.source = CalibrationUsed::Source::layout});
}

}  // namespace

std::shared_ptr<hal::Clock> open_system_clock() { return std::make_shared<drivers::SystemClock>(); }

DepthSource open_source(const Config& config) {
  auto clock = std::make_shared<drivers::SystemClock>();
  const auto& cameras = config.cameras;
  if (cameras.driver == "recording") {
    const drivers::Pace pace = cameras.recording.pace == "fast" ? drivers::Pace::fast : drivers::Pace::own;
    return open_recorded(cameras.recording.path, pace, std::move(clock));
  }
  if (cameras.driver == "kinect2") return open_kinect(config, clock);
#ifdef BOOTHD_EMULATOR
  if (cameras.driver == "kinect2-emulated") return open_emulated_kinect(config, make_scene_person(config), clock);
#endif
  return open_synthetic(config, drivers::Pace::own, std::numeric_limits<double>::infinity(), clock);
}

DepthSource open_recording_source(const std::filesystem::path& path) {
  return open_recorded(path, drivers::Pace::fast, std::make_shared<drivers::ManualClock>());
}

DepthSource open_synthetic_source(const Config& config, double seconds) {
  return open_synthetic(config, drivers::Pace::fast, seconds, std::make_shared<drivers::ManualClock>());
}

}  // namespace booth::daemon
