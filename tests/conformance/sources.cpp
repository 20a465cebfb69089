// One scene, three ways to see it.
#include "tests/conformance/sources.hpp"

#include <stdlib.h>

#include <stdexcept>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/truth_surface.hpp"
#ifdef BOOTHD_EMULATOR
#include "tests/conformance/kinect_source.hpp"
#endif
#include "tests/support/capsule_body.hpp"

namespace booth::tests {

const char* name_of(Kind kind) {
  return kind == Kind::synthetic ? "synthetic" : kind == Kind::folder ? "folder" : kind == Kind::rosbag2 ? "rosbag2" : "kinect2";
}

drivers::SceneSettings scene_settings(std::uint64_t seed) {
  drivers::SceneSettings s;
  s.seed = seed;
  s.seconds = kSceneFrames / 30.0;
  s.phase_spread = 0.01;  // so that every camera has the same number of frames, or one less
  s.cameras = {drivers::camera_ring()[0], drivers::camera_ring()[0]};
  auto& front = s.cameras[kFront];
  front.name = "front";
  front.serial = "synthetic-front";
  // Looks along -x: image right is world +y (his left), image down is world -z.
  front.camera_to_world.rotation = {0, 0, -1, 1, 0, 0, 0, -1, 0};
  front.camera_to_world.translation = {2.6, 0, 1.1};
  return s;
}

drivers::Person scene_person() {
  const auto body = capsule_body();
  const fit::ShapeVector beta;
  fit::Vertices rest;
  body->shaped(beta, rest);
  drivers::Motion raised;
  raised.frames = {drivers::motion_by_name("left-arm", 0, drivers::contact_of(*body, rest, body->rest_joints(beta))).at(2.5)};
  return drivers::make_person("capsule", body, beta, raised);
}

ScratchFolder::ScratchFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "booth-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no scratch folder in " + pattern);
  path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::filesystem::path record_scene(const ScratchFolder& scratch, Kind kind, std::uint64_t seed) {
  const auto path = scratch.path() / (std::string(name_of(kind)) + "-" + std::to_string(seed));
  const auto person = scene_person();
  auto settings = scene_settings(seed);
  settings.pace = drivers::Pace::fast;
  const auto source = drivers::make_scene(settings, {person}, std::make_shared<drivers::ManualClock>());
  const auto sink = drivers::create_recording(path, kind == Kind::folder ? drivers::Layout::folder : drivers::Layout::rosbag2, settings.cameras,
                                              drivers::truth_body(person), source.background);
  for (const auto& camera : source.cameras) camera->start();
  hal::DepthFrame frame;
  const hal::UtcTime base(std::chrono::seconds(1'767'225'600));
  for (bool any = true; any;) {
    any = false;
    for (const auto& camera : source.cameras)
      if (camera->read(frame, std::chrono::seconds(1)) == hal::ReadStatus::frame) {
        any = true;
        const auto utc = base + frame.captured.time_since_epoch();
        sink->write(frame, utc);
        if (hal::to_int(frame.camera) == 0)
          if (const auto truth = source.truth->at(frame.captured)) sink->write_truth(utc, *truth);
      }
  }
  sink->close();
  return path;
}

drivers::Source open_scene(const ScratchFolder& scratch, Kind kind, drivers::Pace pace, std::shared_ptr<hal::Clock> clock, std::uint64_t seed) {
  if (kind == Kind::synthetic) {
    auto settings = scene_settings(seed);
    settings.pace = pace;
    return drivers::make_scene(settings, {scene_person()}, std::move(clock));
  }
#ifdef BOOTHD_EMULATOR
  if (kind == Kind::kinect2) return open_kinect_scene(scene_settings(seed), scene_person(), pace, std::move(clock), kSceneFrames);
#endif
  const auto path = scratch.path() / (std::string(name_of(kind)) + "-" + std::to_string(seed));
  if (!std::filesystem::exists(path)) record_scene(scratch, kind, seed);
  return drivers::open_recording(path, pace, std::move(clock), drivers::truth_surface);
}

}  // namespace booth::tests
