// Reads the simulated cameras to their end and keeps what they gave.
#include "tests/support/frame_memory.hpp"

#include <cmath>
#include <stdexcept>

#include "daemon/io/model_file.hpp"
#include "daemon/io/motion_file.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/pacing/timeline.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::tests {
namespace {

drivers::Person make_person(const SceneRequest& request) {
  const auto folder = daemon::find_models();
  daemon::TestBody body = daemon::load_test_body(folder / "test_bodies.npz", request.body);
  const auto model = std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / (std::string(to_string(body.sex)) + ".npz")));
  const auto contact = drivers::contact_of(*model, body.rest, body.rest_joints);
  drivers::Motion motion;
  if (daemon::is_motion_file(request.motion)) {
    motion.frames = daemon::read_motion(request.motion);
    const auto skipped = std::min<std::ptrdiff_t>(std::lround(request.from * motion.rate), static_cast<std::ptrdiff_t>(motion.frames.size()) - 1);
    motion.frames.erase(motion.frames.begin(), motion.frames.begin() + skipped);
    drivers::place_on_stage(motion, contact, {.leg_scale = drivers::leg_scale(*model, body.rest_joints)});
  } else {
    motion = drivers::motion_by_name(request.motion, request.motion == "showcase" ? 0 : request.seconds, contact);
  }
  auto person = drivers::make_person("test:" + std::to_string(request.body), model, std::move(body.rest), body.rest_joints, std::move(motion));
  person.leaves = request.leaves;
  return person;
}

std::vector<hal::CameraDescription> ring(int divisor) {
  auto cameras = drivers::camera_ring();
  for (auto& camera : cameras) {
    auto& k = camera.intrinsics;
    k.width /= divisor, k.height /= divisor;
    k.fx /= divisor, k.fy /= divisor;
    k.cx = (k.cx + 0.5) / divisor - 0.5, k.cy = (k.cy + 0.5) / divisor - 0.5;
  }
  return cameras;
}

}  // namespace

std::size_t FrameMemory::bytes() const {
  std::size_t sum = 0;
  for (const auto& camera : frames)
    for (const auto& frame : camera) sum += frame.depth.size() * sizeof(std::uint16_t);
  return sum;
}

FrameMemory render_frames(const SceneRequest& request) {
  drivers::SceneSettings settings;
  settings.cameras = ring(request.divisor);
  settings.noise = drivers::NoiseModel::parse("kinect2");
  settings.seed = request.seed;
  settings.pace = drivers::Pace::fast;
  std::vector<drivers::Person> persons;
  persons.push_back(make_person(request));
  const drivers::Motion& motion = persons[0].motion;
  const double length = request.seconds > 0 ? request.seconds : static_cast<double>(motion.frames.size()) / motion.rate;
  const auto count = static_cast<std::size_t>(std::lround(length * 30));
  settings.seconds = static_cast<double>(count + 2) / 30;
  drivers::Source source = drivers::make_scene(settings, std::move(persons), std::make_shared<drivers::ManualClock>());

  FrameMemory out;
  out.truth = source.truth;
  out.background = source.background;
  out.origin = drivers::Timeline::kFastOrigin;
  out.length = std::chrono::nanoseconds(static_cast<std::int64_t>(count) * 1'000'000'000 / 30);
  out.frames.resize(source.cameras.size());
  for (const auto& camera : source.cameras) {
    out.cameras.push_back(camera->description());
    camera->start();
  }
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t c = 0; c < source.cameras.size(); ++c) {
      hal::DepthFrame frame;
      if (source.cameras[c]->read(frame, std::chrono::seconds(60)) != hal::ReadStatus::frame)
        throw std::runtime_error("the simulated camera " + out.cameras[c].name + " ended early");
      out.frames[c].push_back(std::move(frame));
    }
  }
  for (const auto& camera : source.cameras) camera->stop();
  return out;
}

}  // namespace booth::tests
