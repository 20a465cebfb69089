// The knocked camera is rendered by a fifth one, which takes its place when its time has come.
#include "tests/daemon/drift/drift_scene.hpp"

#include <time.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "daemon/io/model_file.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/synthetic/motions.hpp"

namespace booth::tests {

double thread_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

hal::CameraDescription moved(hal::CameraDescription camera, const fit::calibrate::Vector6& knock) {
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(camera.camera_to_world.rotation.data());
  Eigen::Map<Eigen::Vector3d> translation(camera.camera_to_world.translation.data());
  const Eigen::Matrix3d turned = fit::calibrate::rotation_by(knock.head<3>()) * rotation;
  rotation = turned;
  translation += knock.tail<3>();
  return camera;
}

const daemon::FitModels& drift_models() {
  static const daemon::FitModels models = [] {
    const auto folder = daemon::find_models("");
    return daemon::FitModels{std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "men.npz")),
                             std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "women.npz")),
                             std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz"))};
  }();
  return models;
}

namespace {

drivers::Person person_of(int number, const std::string& motion_name) {
  const daemon::TestBody body = daemon::load_test_body(daemon::find_models("") / "test_bodies.npz", number);
  const auto& model = body.sex == fit::Sex::men ? drift_models().men : drift_models().women;
  auto motion = drivers::motion_by_name(motion_name, 0, drivers::contact_of(*model, body.rest, body.rest_joints));
  return drivers::make_person("test:" + std::to_string(number), model, body.rest, body.rest_joints, std::move(motion));
}

}  // namespace

void play(const DriftScene& scene, const std::function<bool(const DriftFrame&)>& each) {
  std::vector<drivers::Person> persons;
  persons.push_back(person_of(scene.body, scene.motion));
  if (scene.next >= 0) {
    persons.push_back(person_of(scene.next, scene.motion));
    persons[0].leaves = scene.gone_at;
    persons[1].enters = scene.gone_at + 0.5;
  }

  drivers::SceneSettings settings;
  settings.cameras = drivers::camera_ring(scene.cameras);
  settings.noise = scene.noise;
  settings.seed = scene.seed;
  settings.pace = drivers::Pace::fast;
  const auto count = settings.cameras.size();
  std::vector<hal::CameraDescription> told = scene.told.empty() ? settings.cameras : scene.told;
  if (scene.knocked >= 0) settings.cameras.push_back(moved(settings.cameras.at(static_cast<std::size_t>(scene.knocked)), scene.knock));
  drivers::Source source = drivers::make_scene(settings, std::move(persons), std::make_shared<drivers::ManualClock>());

  fit::CloudSettings cloud;
  cloud.threads = 1;
  fit::EstimatorSettings estimator;
  estimator.threads = 1;
  std::erase_if(source.background, [&](const hal::DepthFrame& f) { return hal::to_int(f.camera) >= static_cast<int>(count); });
  daemon::EstimatorFitter fitter(told, source.background, drift_models(), cloud, estimator);
  std::vector<hal::DepthFrame> frames(source.cameras.size());
  for (auto& camera : source.cameras) camera->start();
  for (int k = 0; k < static_cast<int>(scene.seconds * 30); ++k) {
    const double time = k / 30.0;
    for (std::size_t c = 0; c < frames.size(); ++c)
      if (source.cameras[c]->read(frames[c], std::chrono::seconds(60)) != hal::ReadStatus::frame) throw std::runtime_error("a simulated camera ended early");
    daemon::FitInput input;
    input.frame = static_cast<std::uint64_t>(k);
    hal::Nanoseconds sum{};
    for (std::size_t c = 0; c < count; ++c) {
      hal::DepthFrame& frame = static_cast<int>(c) == scene.knocked && time >= scene.knocked_at ? frames.back() : frames[c];
      frame.captured += hal::from_seconds(scene.late[c]);
      input.frames[c] = &frame;
      sum += frame.captured.time_since_epoch();
    }
    input.reference = hal::MonotonicTime(sum / static_cast<std::int64_t>(count));
    daemon::FrameRecord record;
    const double before = thread_ms();
    fitter.step(input, record);
    if (!each({.time = time, .fitter = &fitter, .record = &record, .milliseconds = thread_ms() - before})) break;
  }
  for (auto& camera : source.cameras) camera->stop();
}

}  // namespace booth::tests
