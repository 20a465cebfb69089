// The part of the drivers factory that makes recordings of simulated people.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <stdexcept>

#include "daemon/io/model_file.hpp"
#include "daemon/io/motion_file.hpp"
#include "daemon/simulation.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/truth_surface.hpp"

namespace booth::daemon {
namespace {

struct Body {
  std::shared_ptr<const fit::BodyModel> model;
  fit::Vertices rest;
  fit::Points3 joints;
  fit::ShapeVector beta;
};

Body load_body(const SimulationRequest& request) {
  const auto folder = find_models(request.models);
  const auto model_of = [&](fit::Sex sex) { return std::make_shared<const fit::BodyModel>(load_body_model(folder / (std::string(to_string(sex)) + ".npz"))); };
  Body body;
  if (request.body.starts_with("test:")) {
    int number = 0;
    const char *first = request.body.data() + 5, *last = request.body.data() + request.body.size();
    if (const auto [end, error] = std::from_chars(first, last, number); error != std::errc() || end != last)
      throw std::invalid_argument(fmt::format("--body {}: test: must be followed by the number of a body, e.g. test:7", request.body));
    if (!request.beta.empty()) throw std::invalid_argument("--beta shapes a body of the model; a test body has a shape of its own: leave one of the two out");
    TestBody test = load_test_body(folder / "test_bodies.npz", number);
    body.model = model_of(test.sex);
    body.rest = std::move(test.rest);
    body.joints = test.rest_joints;
    return body;
  }
  if (request.body != "men" && request.body != "women") throw std::invalid_argument(fmt::format("--body {}: allowed are men, women and test:N", request.body));
  body.model = model_of(request.body == "women" ? fit::Sex::women : fit::Sex::men);
  const int most = body.model->shape_count();
  if (static_cast<int>(request.beta.size()) > most)
    throw std::invalid_argument(fmt::format("--beta has {} numbers, the model has {} coefficients", request.beta.size(), most));
  body.beta = fit::ShapeVector::Zero(most);
  for (std::size_t k = 0; k < request.beta.size(); ++k) {
    if (!(std::abs(request.beta[k]) <= 10)) throw std::invalid_argument("--beta: each coefficient is in standard deviations and must be from -10 to 10");
    body.beta[static_cast<Eigen::Index>(k)] = request.beta[k];
  }
  body.model->shaped(body.beta, body.rest);
  body.joints = body.model->rest_joints(body.beta);
  return body;
}

drivers::Motion load_motion(const SimulationRequest& request, const Body& body) {
  const auto contact = drivers::contact_of(*body.model, body.rest, body.joints);
  if (!is_motion_file(request.motion)) {
    if (request.from != 0) throw std::invalid_argument("--from belongs to a motion file; the motion '" + request.motion + "' starts at its start");
    return drivers::motion_by_name(request.motion, request.seconds, contact);
  }
  drivers::Motion motion;
  motion.frames = read_motion(request.motion);
  const double length = motion.seconds();
  if (!(request.from >= 0 && request.from <= length))
    throw std::invalid_argument(fmt::format("--from {}: {} is {:.2f} s long", request.from, request.motion, length));
  motion.frames.erase(motion.frames.begin(), motion.frames.begin() + std::lround(request.from * motion.rate));
  if (request.seconds > 0) motion.frames.resize(std::min(motion.frames.size(), static_cast<std::size_t>(std::lround(request.seconds * motion.rate)) + 1));
  drivers::place_on_stage(motion, contact, {.keep_path = request.keep_path, .leg_scale = drivers::leg_scale(*body.model, body.joints)});
  return motion;
}

}  // namespace

Simulation open_simulation(const SimulationRequest& request) {
  if (!(request.seconds >= 0 && request.seconds <= 86400)) throw std::invalid_argument("--seconds must be from 0 (as long as the motion) to 86400");
  if (request.layout != "rosbag2" && request.layout != "folder")
    throw std::invalid_argument(fmt::format("--layout {}: allowed are rosbag2 and folder", request.layout));
  drivers::SceneSettings scene;
  scene.cameras = drivers::camera_ring();
  scene.noise = drivers::NoiseModel::parse(request.noise);
  scene.seed = request.seed;
  scene.pace = drivers::Pace::fast;

  const Body body = load_body(request);
  drivers::Motion motion = load_motion(request, body);
  // A still pose lasts as long as it is looked at; anything else ends with its last frame.
  scene.seconds = request.seconds > 0 && (motion.frames.size() == 1 || !is_motion_file(request.motion)) ? request.seconds : motion.seconds();
  if (!(scene.seconds > 0)) throw std::invalid_argument("the motion is a single pose: say with --seconds how long to look at it");
  drivers::Person person = drivers::make_person(request.body, body.model, body.rest, body.joints, std::move(motion));
  person.beta = body.beta;

  Simulation simulation;
  simulation.seconds = scene.seconds;
  const auto truth = drivers::truth_body(person);
  const auto clock = std::make_shared<drivers::ManualClock>();
  const auto cameras = scene.cameras;
  auto source = drivers::make_scene(std::move(scene), {std::move(person)}, clock);
  simulation.sink = drivers::create_recording(request.out, request.layout == "folder" ? drivers::Layout::folder : drivers::Layout::rosbag2, cameras, truth,
                                              source.background);
  simulation.source = {.clock = clock,
                       .cameras = std::move(source.cameras),
                       .truth = std::move(source.truth),
                       .background = std::move(source.background),
                       .name = fmt::format("synthetic: {} {} noise {} seed {}", request.body, request.motion, request.noise, request.seed)};
  return simulation;
}

}  // namespace booth::daemon
