// The embedded booth: bodies in motion in a room, seen by simulated depth cameras, with the truth known at every instant.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/source.hpp"
#include "drivers/synthetic/motion.hpp"
#include "drivers/synthetic/noise.hpp"
#include "fit/body/body_model.hpp"
#include "hal/clock.hpp"

namespace booth::drivers {

/// Somebody in the scene. Make one with make_person().
struct Person {
  std::string name;                             ///< for the truth, e.g. "test:7"
  std::shared_ptr<const fit::BodyModel> model;  ///< topology and skinning
  fit::Vertices rest;                           ///< resting vertices; need not lie in the model's shape space
  fit::Points3 rest_joints;
  fit::ShapeVector beta;  ///< empty when the body is not in the shape space
  Motion motion;
  Eigen::Vector2d stand_at{0, 0};  ///< where the motion's origin lies, booth frame (x forward, y left), metres
  double enters = 0;               ///< seconds of scene time; before it nobody is there
  double leaves = std::numeric_limits<double>::infinity();
};

/// The points of a body's soles, for motion_by_name() and place_on_stage().
Contact contact_of(const fit::BodyModel& model, const fit::Vertices& rest, const fit::Points3& rest_joints);
/// Leg length (thigh and shank) over that of the CMU average skeleton.
double leg_scale(const fit::BodyModel& model, const fit::Points3& rest_joints);

/// A body of the shape space.
Person make_person(std::string name, std::shared_ptr<const fit::BodyModel> model, const fit::ShapeVector& beta, Motion motion);
/// A body with its own resting mesh and joints on the model's topology (the model's sex and skin weights serve it).
Person make_person(std::string name, std::shared_ptr<const fit::BodyModel> model, fit::Vertices rest, const fit::Points3& rest_joints, Motion motion);

/// An axis-aligned obstacle, booth frame, metres.
struct Box {
  std::array<double, 3> low, high;
};
/// Seat, back and four legs around (x, y), the back towards -x.
std::vector<Box> chair(double x, double y);

struct SceneSettings {
  /// Empty: camera_ring(). Any resolution; each needs a rotation and finite intrinsics.
  std::vector<hal::CameraDescription> cameras;
  NoiseModel noise;
  std::uint64_t seed = 1;
  double phase_spread = 1.0 / 30;  ///< seconds; each camera's clock starts at a random offset in [0, phase_spread)
  double jitter = 0.0002;          ///< standard deviation of a frame's instant, seconds; clipped at three
  double delivery_delay = 0.015;   ///< from the middle of the exposure to the host having the frame, seconds
  double room_half_width = 3.0;    ///< walls at x, y = +-this; 0: no walls
  bool floor = true;
  double range_min = 0.5, range_max = 8.0;  ///< metres along z; outside there is no measurement
  std::vector<Box> obstacles;
  Pace pace = Pace::own;
  double seconds = std::numeric_limits<double>::infinity();  ///< after it read() says `ended`
};

/// `count` Kinect v2 on a circle through the corners of a 4 m square, 1.6 m high, aimed at (0, 0, 0.95); four: front-left, back-left,
/// back-right, front-right. Intrinsics are typical ones of the device.
std::vector<hal::CameraDescription> camera_ring(int count = 4);

/// The truth is that of the first person; null when there is none. The background holds one frame of the empty room for each camera.
/// Allocates and renders the room here; frames are rendered in read(), on the reader's thread. Cameras keep the scene alive.
/// Throws std::invalid_argument naming the setting that is wrong.
Source make_scene(SceneSettings settings, std::vector<Person> persons, std::shared_ptr<hal::Clock> clock);

/// The same scene for an emulated device, which decides itself when it looks.
struct SceneViews {
  /// One for each camera: its picture at an instant, counts as in DepthFrame. Different cameras may be asked by different threads.
  std::vector<std::function<void(hal::MonotonicTime at, std::span<std::uint16_t> depth)>> cameras;
  std::shared_ptr<const hal::GroundTruth> truth;
  std::vector<hal::DepthFrame> background;
};
/// Scene time begins now. `pace`, `phase_spread`, `jitter`, `delivery_delay` and `seconds` say nothing here.
SceneViews make_scene_views(SceneSettings settings, std::vector<Person> persons, std::shared_ptr<hal::Clock> clock);

}  // namespace booth::drivers
