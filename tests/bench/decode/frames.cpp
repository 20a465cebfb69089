// Depth from the simulated booth, through the emulator's forward model.
#include "tests/bench/decode/frames.hpp"

#include <algorithm>
#include <chrono>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::bench {
namespace {

using namespace drivers::kinect2;

constexpr double kNoiseCounts = 5;

drivers::Person person() {
  const auto body = tests::capsule_body();
  fit::Vertices rest;
  body->shaped(fit::ShapeVector(), rest);
  const auto contact = drivers::contact_of(*body, rest, body->rest_joints(fit::ShapeVector()));
  return drivers::make_person("capsule", body, fit::ShapeVector(), drivers::motion_by_name("showcase", 0, contact));
}

PackedFrame encode(const emulator::ForwardModel& model, const std::vector<float>& depth, const std::vector<float>& infrared, int i) {
  PackedFrame frame(kFrameBytes);
  model.encode(depth, infrared, kNoiseCounts, static_cast<std::uint64_t>(i) + 1, frame);
  return frame;
}

}  // namespace

std::vector<PackedFrame> person_frames(const PhaseOffsets& phase, int count) {
  using namespace std::chrono_literals;
  const auto lens = emulator::typical_camera();
  const emulator::ForwardModel model(lens, phase);
  drivers::SceneSettings settings;
  settings.cameras = drivers::camera_ring();
  for (auto& camera : settings.cameras) {
    camera.intrinsics = unmirrored_intrinsics(lens);
    camera.depth_scale = 0.0001;
  }
  settings.noise.kind = drivers::NoiseModel::Kind::none;  // the measurements get it
  auto clock = std::make_shared<drivers::ManualClock>();
  const auto views = drivers::make_scene_views(settings, {person()}, clock);
  std::vector<std::uint16_t> picture(kPixels);
  std::vector<float> depth(kPixels), infrared(kPixels);
  std::vector<PackedFrame> out;
  for (int i = 0; i < count; ++i) {
    clock->advance(250ms);
    views.cameras[static_cast<std::size_t>(i) % views.cameras.size()](clock->now(), picture);
    for (std::size_t r = 0; r < static_cast<std::size_t>(kHeight); ++r)
      for (std::size_t c = 0; c < static_cast<std::size_t>(kWidth); ++c) {
        const std::size_t to = r * kWidth + c;
        const float z = 0.1f * static_cast<float>(picture[r * kWidth + kWidth - 1 - c]), metres = 0.001f * z;
        depth[to] = z;
        infrared[to] = z > 0 ? std::clamp(20000.0f / (metres * metres), 400.0f, 20000.0f) : 0.0f;
      }
    out.push_back(encode(model, depth, infrared, i));
  }
  return out;
}

std::vector<PackedFrame> worst_frames(const PhaseOffsets& phase, int count) {
  const emulator::ForwardModel model(emulator::typical_camera(), phase);
  std::vector<float> depth(kPixels);
  const std::vector<float> infrared(kPixels, 6000.0f);
  for (std::size_t i = 0; i < kPixels; ++i) depth[i] = 700 + 3600 * static_cast<float>(i % kWidth) / (kWidth - 1);
  std::vector<PackedFrame> out;
  for (int i = 0; i < count; ++i) out.push_back(encode(model, depth, infrared, i));
  return out;
}

}  // namespace booth::bench
