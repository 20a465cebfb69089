// The poses are the frames of a motion whose cameras have neither phase nor jitter: every frame shows exactly one of them.
#include "tests/accuracy/booth/stills.hpp"

#include <stdexcept>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::accuracy {
namespace {

std::vector<fit::Camera> fit_cameras() {
  std::vector<fit::Camera> out;
  for (const auto& c : drivers::camera_ring(kCameras)) out.push_back(daemon::fit_camera(c));
  return out;
}

fit::CloudSettings one_thread() {
  fit::CloudSettings s;
  s.threads = 1;
  return s;
}

}  // namespace

Stills render_stills(const Subject& subject, const std::vector<fit::PoseVector>& poses, const drivers::NoiseModel& noise, std::uint64_t seed) {
  drivers::SceneSettings settings;
  settings.noise = noise;
  settings.seed = seed;
  settings.phase_spread = settings.jitter = 0;
  settings.pace = drivers::Pace::fast;
  drivers::Motion motion;
  motion.frames = poses;
  auto person = drivers::make_person("test:" + std::to_string(subject.number), subject.model, subject.body->rest, subject.body->rest_joints, std::move(motion));
  drivers::Source source = drivers::make_scene(settings, {std::move(person)}, std::make_shared<drivers::ManualClock>());
  Stills out;
  out.background = source.background;
  out.frames.resize(poses.size());
  for (auto& camera : source.cameras) camera->start();
  for (auto& frames : out.frames) {
    frames.resize(source.cameras.size());
    for (std::size_t c = 0; c < frames.size(); ++c)
      if (source.cameras[c]->read(frames[c], std::chrono::seconds(60)) != hal::ReadStatus::frame) throw std::runtime_error("a simulated camera gave no frame");
  }
  for (auto& camera : source.cameras) camera->stop();
  return out;
}

Booth::Booth() : builder_(one_thread(), fit_cameras()), observation_(builder_.make_observation(kCloudCapacity)) {}

const fit::Observation& Booth::look(const Stills& stills, std::size_t pose, unsigned cameras) {
  for (const auto& b : stills.background) builder_.set_background(hal::to_int(b.camera), b.depth);
  std::vector<fit::DepthInput> inputs;
  for (int c = 0; c < kCameras; ++c)
    if ((cameras >> c) & 1u) inputs.push_back({c, stills.frames[pose][static_cast<std::size_t>(c)].depth.data(), 0});
  observation_.frame = pose;
  observation_.time = 0;
  fit::CloudReport report;
  builder_.build(inputs, observation_, report);
  return observation_;
}

}  // namespace booth::accuracy
