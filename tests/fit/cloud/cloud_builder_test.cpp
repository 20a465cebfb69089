// From depth images to the person: easy rooms, hard rooms, and what the report says of each.
#include "fit/cloud/cloud_builder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <random>
#include <stdexcept>

#include "analytic_scene.hpp"
#include "fit/cloud/pixel_rays.hpp"
#include "fit/cloud/projection.hpp"
#include "fit/cloud/silhouette.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::fit {
namespace {

using tests::booth_cameras;
using tests::BoothFrame;
using tests::Scene;

struct Built {
  explicit Built(CloudBuilder& builder, std::span<const DepthInput> inputs, int capacity = 120000, const Followed& followed = {})
      : observation(builder.make_observation(capacity)) {
    person = builder.build(inputs, observation, report, followed);
  }
  Observation observation;
  CloudReport report;
  bool person = false;
};

Built build(const Scene& scene, CloudSettings settings = {}, int cameras = 4) {
  const auto rig = booth_cameras(cameras);
  const BoothFrame frame(scene, rig);
  CloudBuilder builder(settings, rig);
  return Built(builder, frame.inputs);
}

void expect_balanced(const CloudReport& r) { EXPECT_EQ(r.raw, r.cropped + r.floor + r.isolated + r.flying + r.other + r.person); }

/// Of the pixels that the scene's owner covers, the part with this label.
double labelled(const Built& built, const BoothFrame& frame, int owner, PixelLabel label) {
  double all = 0, hit = 0;
  for (std::size_t c = 0; c < frame.images.size(); ++c)
    for (std::size_t i = 0; i < frame.images[c].owner.size(); ++i)
      if (frame.images[c].owner[i] == owner) ++all, hit += built.observation.views[c].label[i] == label;
  return all > 0 ? hit / all : -1;
}

TEST(CloudBuilder, UndoesWhatACalibrationFoundOfACamerasDepth) {
  Scene scene;
  scene.add_person(0.1f, -0.2f);
  const auto rig = booth_cameras();
  BoothFrame frame(scene, rig);
  const auto off_surface = [&](const std::vector<Camera>& cameras) {
    CloudBuilder builder({}, cameras);
    const Built built(builder, frame.inputs);
    double sum = 0, n = 0;
    for (int i = 0; i < built.observation.cloud.size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Eigen::Vector3f p(built.observation.cloud.x[k], built.observation.cloud.y[k], built.observation.cloud.z[k]);
      float nearest = 1;
      for (const auto& c : scene.capsules) {
        const Eigen::Vector3f axis = c.b - c.a;
        const float t = std::clamp(axis.dot(p - c.a) / std::max(axis.squaredNorm(), 1e-9f), 0.0f, 1.0f);
        nearest = std::min(nearest, std::abs((p - c.a - t * axis).norm() - c.radius));
      }
      sum += static_cast<double>(nearest), ++n;
    }
    return n > 0 ? 1000 * sum / n : 1e9;
  };
  const double right = off_surface(rig);
  std::vector<Camera> told = rig;
  for (std::size_t c = 0; c < 4; ++c) {
    const double gain = 0.004 * (c % 2 == 0 ? 1 : -1), offset = 0.006 * (static_cast<double>(c) - 1.5);
    for (auto& count : frame.images[c].depth)
      if (count > 0) count = static_cast<std::uint16_t>(std::lround((1 + gain) * count + 1000 * offset));
    told[c].depth_scale = static_cast<float>(0.001 / (1 + gain));
    told[c].depth_offset = static_cast<float>(-offset / (1 + gain));
  }
  const double wrong = off_surface(rig), corrected = off_surface(told);
  std::printf("off the surface: %.2f mm with right cameras, %.2f mm with wrong ones, %.2f mm with corrected ones\n", right, wrong, corrected);
  EXPECT_GT(wrong, right + 2);
  EXPECT_LT(corrected, right + 0.3);
}

TEST(CloudBuilder, FindsThePersonAndNothingElse) {
  for (const float noise : {0.0f, 0.003f}) {
    Scene scene;
    scene.add_person(0.1f, -0.2f);
    scene.noise = noise;
    const auto rig = booth_cameras();
    const BoothFrame frame(scene, rig);
    CloudBuilder builder({}, rig);
    const Built built(builder, frame.inputs);
    ASSERT_TRUE(built.person) << describe(built.report.outcome);
    expect_balanced(built.report);
    EXPECT_EQ(built.report.frames, 4);
    EXPECT_EQ(built.report.persons, 1);
    EXPECT_EQ(built.report.other_components, 0);
    EXPECT_FALSE(built.report.touches_border);
    EXPECT_EQ(built.report.points, built.observation.cloud.size);
    EXPECT_GT(built.report.points, 20000);
    EXPECT_GT(labelled(built, frame, 1, PixelLabel::person), 0.93);
    EXPECT_LT(labelled(built, frame, 0, PixelLabel::person), 0.001);
    EXPECT_LT(labelled(built, frame, -1, PixelLabel::person), 0.001);
    EXPECT_GT(labelled(built, frame, 0, PixelLabel::background), 0.99);
    EXPECT_GT(labelled(built, frame, -1, PixelLabel::background), 0.97);
    EXPECT_TRUE(built.observation.floor_known);
    EXPECT_TRUE(built.report.floor_measured);
    EXPECT_NEAR(built.observation.floor_height, 0, 0.002f);
    for (std::size_t c = 0; c < 4; ++c) {
      EXPECT_TRUE(built.observation.views[c].valid);
      EXPECT_FLOAT_EQ(built.observation.views[c].time_offset, 0.001f * static_cast<float>(c));
    }
    // Every point lies on the figure's surface, as far as noise and millimetre counts allow.
    double worst = 0, sum = 0;
    for (int i = 0; i < built.observation.cloud.size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Cloud& cloud = built.observation.cloud;
      const Eigen::Vector3f p(cloud.x[k], cloud.y[k], cloud.z[k]);
      float nearest = 10;
      for (const auto& part : scene.capsules) {
        const float t = std::clamp((p - part.a).dot(part.b - part.a) / (part.b - part.a).squaredNorm(), 0.0f, 1.0f);
        nearest = std::min(nearest, std::abs((p - part.a - t * (part.b - part.a)).norm() - part.radius));
      }
      sum += nearest;
      worst = std::max<double>(worst, nearest);
    }
    EXPECT_LT(sum / built.observation.cloud.size, 0.001 + noise);
    EXPECT_LT(worst, 0.004 + 6 * noise);
  }
}

TEST(CloudBuilder, NormalsPointOutOfTheSurfaceTowardsTheCamera) {
  for (const float noise : {0.0f, 0.003f}) {
    Scene scene;
    scene.add_person(0, 0);
    scene.noise = noise;
    const auto rig = booth_cameras();
    const BoothFrame frame(scene, rig);
    CloudBuilder builder({}, rig);
    const Built built(builder, frame.inputs);
    const Cloud& cloud = built.observation.cloud;
    double within20 = 0, known = 0;
    for (int i = 0; i < cloud.size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Eigen::Vector3f p(cloud.x[k], cloud.y[k], cloud.z[k]), n(cloud.nx[k], cloud.ny[k], cloud.nz[k]);
      if (n.isZero()) continue;
      ++known;
      ASSERT_NEAR(n.norm(), 1, 1e-4f);
      const Camera& camera = rig[cloud.camera[k]];
      ASSERT_GT(n.dot(camera.centre() - p), 0);
      const Pixel pixel = project(camera, p);
      const auto at = static_cast<std::size_t>(std::lround(pixel.v) * camera.width + std::lround(pixel.u));
      within20 += n.dot(frame.images[cloud.camera[k]].normal[at]) > std::cos(20 * std::numbers::pi / 180);
    }
    EXPECT_GT(known / cloud.size, 0.95);
    EXPECT_GT(within20 / known, noise > 0 ? 0.85 : 0.93);
  }
}

TEST(CloudBuilder, EmptyRoom) {
  Scene scene;
  scene.noise = 0.003f;
  const Built built = build(scene);
  EXPECT_FALSE(built.person);
  EXPECT_EQ(built.report.outcome, CloudOutcome::empty_stage);
  EXPECT_STREQ(describe(built.report.outcome), "the stage is empty");
  EXPECT_EQ(built.observation.cloud.size, 0);
  EXPECT_EQ(built.report.persons, 0);
  EXPECT_GT(built.report.floor, 10000);
  expect_balanced(built.report);
  for (const auto& view : built.observation.views)
    for (const std::int16_t d : view.nearest_dx) ASSERT_EQ(d, kSilhouetteFar);
}

TEST(CloudBuilder, AllPixelsInvalid) {
  const auto rig = booth_cameras();
  const std::vector<std::uint16_t> zero(512 * 424, 0), broken(512 * 424, 65535);
  CloudBuilder builder({}, rig);
  for (const auto* image : {&zero, &broken}) {
    std::vector<DepthInput> inputs;
    for (int c = 0; c < 4; ++c) inputs.push_back({c, image->data(), 0});
    const Built built(builder, inputs);
    EXPECT_FALSE(built.person);
    EXPECT_EQ(built.report.outcome, CloudOutcome::no_measurement);
    EXPECT_EQ(built.report.raw, 0);
    for (const PixelLabel l : built.observation.views[0].label) ASSERT_EQ(l, PixelLabel::unknown);
  }
}

TEST(CloudBuilder, RandomPixelsAreRubbleAndNotAPerson) {
  const auto rig = booth_cameras();
  std::mt19937 random(1);
  std::vector<std::uint16_t> image(512 * 424);
  for (auto& d : image) d = static_cast<std::uint16_t>(random());
  CloudBuilder builder({}, rig);
  std::vector<DepthInput> inputs;
  for (int c = 0; c < 4; ++c) inputs.push_back({c, image.data(), 0});
  const Built built(builder, inputs);
  EXPECT_FALSE(built.person);
  expect_balanced(built.report);
}

TEST(CloudBuilder, NoFrameAndWrongInputs) {
  const auto rig = booth_cameras();
  CloudBuilder builder({}, rig);
  const std::vector<std::uint16_t> image(512 * 424, 0);
  EXPECT_EQ(Built(builder, {}).report.outcome, CloudOutcome::no_frame);
  const std::vector<DepthInput> wrong{{-1, image.data(), 0}, {4, image.data(), 0}, {1, nullptr, 0}};
  EXPECT_EQ(Built(builder, wrong).report.outcome, CloudOutcome::no_frame);
  Observation strange(100);
  CloudReport report;
  EXPECT_FALSE(builder.build({}, strange, report));
  EXPECT_EQ(report.outcome, CloudOutcome::unprepared);
  strange.views.resize(4);
  EXPECT_FALSE(builder.build({}, strange, report));
  EXPECT_EQ(report.outcome, CloudOutcome::unprepared);
}

TEST(CloudBuilder, OneCameraOfFour) {
  Scene scene;
  scene.add_person(0, 0);
  scene.noise = 0.003f;
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  Observation out = builder.make_observation(120000);
  CloudReport report;
  ASSERT_TRUE(builder.build(frame.inputs, out, report));  // so that there is something of an earlier frame to be forgotten
  for (int camera = 0; camera < 4; ++camera) {
    const DepthInput one[] = {frame.inputs[static_cast<std::size_t>(camera)]};
    ASSERT_TRUE(builder.build(one, out, report)) << describe(report.outcome);
    expect_balanced(report);
    EXPECT_EQ(report.frames, 1);
    EXPECT_GT(report.points, 5000);
    for (int i = 0; i < out.cloud.size; ++i) ASSERT_EQ(out.cloud.camera[static_cast<std::size_t>(i)], camera);
    for (int c = 0; c < 4; ++c) {
      const View& view = out.views[static_cast<std::size_t>(c)];
      EXPECT_EQ(view.valid, c == camera);
      if (c != camera) {
        for (std::size_t i = 0; i < view.label.size(); ++i) ASSERT_TRUE(view.label[i] == PixelLabel::unknown && view.depth[i] == 0);
        for (const std::int16_t d : view.nearest_dx) ASSERT_EQ(d, kSilhouetteFar);
      }
    }
  }
}

TEST(CloudBuilder, PersonHalfOutOfTheCylinder) {
  Scene scene;
  scene.add_person(0, 1.95f);
  scene.wall = 4;
  const Built built = build(scene);
  ASSERT_TRUE(built.person) << "half a person is still of a person's size";
  EXPECT_TRUE(built.report.touches_border);
  const Cloud& cloud = built.observation.cloud;
  for (int i = 0; i < cloud.size; ++i) ASSERT_LT(std::hypot(cloud.x[static_cast<std::size_t>(i)], cloud.z[static_cast<std::size_t>(i)]), 2.003f);

  Scene gone;
  gone.add_person(0, 2.5f);
  gone.wall = 4;
  EXPECT_EQ(build(gone).report.outcome, CloudOutcome::empty_stage);
}

TEST(CloudBuilder, OfTwoPeopleTheOneNearestTheCentre) {
  for (const bool swapped : {false, true}) {
    Scene scene;
    scene.add_person(swapped ? 0.95f : -0.3f, 0, 1);
    scene.add_person(swapped ? -0.3f : 0.95f, 0, 2);
    scene.noise = 0.003f;
    const auto rig = booth_cameras();
    const BoothFrame frame(scene, rig);
    CloudBuilder builder({}, rig);
    const Built built(builder, frame.inputs);
    ASSERT_TRUE(built.person);
    EXPECT_EQ(built.report.persons, 2);
    EXPECT_EQ(built.report.other_components, 1);
    const int tracked = swapped ? 2 : 1;
    EXPECT_GT(labelled(built, frame, tracked, PixelLabel::person), 0.9);
    EXPECT_EQ(labelled(built, frame, 3 - tracked, PixelLabel::person), 0);
    EXPECT_GT(labelled(built, frame, 3 - tracked, PixelLabel::background), 0.9);
    EXPECT_GT(built.report.other, 10000);
  }
}

/// What a tracker would say of the scene's figure.
std::vector<Followed::Bone> bones_of(const Scene& scene, int owner) {
  std::vector<Followed::Bone> out;
  for (const auto& c : scene.capsules)
    if (c.owner == owner) out.push_back({c.a, c.b, c.radius + 0.08f});
  return out;
}

TEST(CloudBuilder, WhoIsFollowedIsThePersonWhereverTheyStand) {
  Scene scene;
  scene.add_person(-0.3f, 0, 1);
  scene.add_person(0.95f, 0, 2);
  scene.noise = 0.003f;
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  const auto first = bones_of(scene, 1), second = bones_of(scene, 2);
  for (const auto& [bones, now, person] : {std::tuple{&first, true, 1}, {&second, true, 2}, {&second, false, 2}}) {
    const Built built(builder, frame.inputs, 120000, {*bones, now});
    EXPECT_EQ(built.report.persons, 2);
    EXPECT_FALSE(built.report.crowded);
    EXPECT_GT(labelled(built, frame, person, PixelLabel::person), 0.9);
    EXPECT_EQ(labelled(built, frame, 3 - person, PixelLabel::person), 0);
    expect_balanced(built.report);
  }
}

TEST(CloudBuilder, NobodyElseBecomesThePersonUntilTheyMayHaveStrayedSoFar) {
  Scene scene;
  scene.add_person(-0.3f, 0, 1);
  scene.add_person(0.95f, 0.3f, 2);
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  Scene before;
  before.add_person(1.4f, 1.0f, 3);  // 0.8 m from the second, 2 m from the first
  const auto bones = bones_of(before, 3);
  EXPECT_EQ(Built(builder, frame.inputs, 120000, {bones, true, false, 0.5f}).report.outcome, CloudOutcome::nobody);
  const Built moved(builder, frame.inputs, 120000, {bones, true, false, 1.3f});
  EXPECT_GT(labelled(moved, frame, 2, PixelLabel::person), 0.9) << "the nearest to the bones, not to the centre";
  EXPECT_GT(labelled(Built(builder, frame.inputs), frame, 1, PixelLabel::person), 0.9);
}

TEST(CloudBuilder, WhoTouchesThePersonIsCutOff) {
  Scene scene;
  scene.add_person(0, 0, 1);
  scene.add_person(0.55f, 0, 2);
  scene.noise = 0.003f;
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  ASSERT_EQ(Built(builder, frame.inputs).report.persons, 1) << "they are one piece";
  for (const int person : {1, 2}) {
    const auto bones = bones_of(scene, person);
    const Built built(builder, frame.inputs, 120000, {bones, true});
    EXPECT_TRUE(built.report.crowded);
    EXPECT_TRUE(built.observation.crowded);
    EXPECT_EQ(built.report.persons, 2);
    EXPECT_GT(labelled(built, frame, person, PixelLabel::person), 0.9);
    EXPECT_LT(labelled(built, frame, 3 - person, PixelLabel::person), 0.2);
    EXPECT_GT(labelled(built, frame, 3 - person, PixelLabel::background), 0.7);
    expect_balanced(built.report);
    EXPECT_FALSE(Built(builder, frame.inputs, 120000, {bones, false}).report.crowded) << "older bones cut nobody";
  }
}

TEST(CloudBuilder, ALimbThatTheTrackerLostIsNotCutOff) {
  Scene scene;
  scene.add_person(0, 0, 1);
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  auto bones = bones_of(scene, 1);
  std::vector<std::size_t> trunk;
  for (std::size_t lost = 0; lost < bones.size(); ++lost) {
    auto without = bones;
    without.erase(without.begin() + static_cast<std::ptrdiff_t>(lost));
    if (Built(builder, frame.inputs, 120000, {without, true}).report.crowded) trunk.push_back(lost);
  }
  EXPECT_LE(trunk.size(), 1u) << "only without the trunk so much of them is far from all bones";
}

TEST(CloudBuilder, AChairThatTouchesIsNobodyWhoTouches) {
  Scene scene;
  scene.add_squatting_person(0, 0, 1);
  scene.add_chair(0, -0.45f, 9);
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  const auto bones = bones_of(scene, 1);
  const Built built(builder, frame.inputs, 120000, {bones, true});
  ASSERT_TRUE(built.person);
  EXPECT_FALSE(built.report.crowded) << "it is too low";
}

TEST(CloudBuilder, FurnitureIsNobodyWithoutTheTrackersWord) {
  Scene scene;
  scene.add_chair(0, 0, 9);
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  EXPECT_FALSE(Built(builder, frame.inputs).person);
  const std::vector<Followed::Bone> sitting{{{0, 0.1f, 0}, {0, 0.9f, 0}, 0.5f}};
  EXPECT_TRUE(Built(builder, frame.inputs, 120000, {sitting, true}).person);
  EXPECT_FALSE(Built(builder, frame.inputs, 120000, {sitting, false}).person);
}

TEST(CloudBuilder, AChairIsNobodyAndASquattingPersonSomebody) {
  Scene chair;
  chair.add_chair(0, 0);
  chair.noise = 0.003f;
  for (const int cameras : {1, 2, 4}) {
    const Built alone = build(chair, {}, cameras);
    EXPECT_FALSE(alone.person) << cameras;
    EXPECT_EQ(alone.report.outcome, CloudOutcome::nobody);
    EXPECT_EQ(alone.report.other_components, 1);
    expect_balanced(alone.report);
  }
  Scene squat;
  squat.add_squatting_person(0, 0);
  squat.noise = 0.003f;
  for (const int cameras : {1, 2, 4}) EXPECT_TRUE(build(squat, {}, cameras).person) << cameras;

  // The chair is nearer the centre, and the person is tracked all the same.
  Scene both = chair;
  both.add_person(0.8f, 0.3f);
  const auto rig = booth_cameras();
  const BoothFrame frame(both, rig);
  CloudBuilder builder({}, rig);
  const Built built(builder, frame.inputs);
  ASSERT_TRUE(built.person);
  EXPECT_EQ(built.report.persons, 1);
  EXPECT_EQ(labelled(built, frame, 9, PixelLabel::person), 0);
  EXPECT_GT(labelled(built, frame, 1, PixelLabel::person), 0.9);
}

TEST(CloudBuilder, ABackgroundImageTakesTheFurnitureAway) {
  Scene room;
  room.boxes.push_back({{-1.2f, 0, -0.4f}, {-0.7f, 1.5f, 0.4f}, 9});  // a cupboard of a person's size
  Scene used = room;
  used.add_person(0.5f, 0);
  const auto rig = booth_cameras();
  const BoothFrame before(room, rig), frame(used, rig);
  CloudBuilder builder({}, rig);
  EXPECT_EQ(Built(builder, frame.inputs).report.persons, 2) << "without the image it cannot be told from a person";
  for (int c = 0; c < 4; ++c) builder.set_background(c, before.images[static_cast<std::size_t>(c)].depth);
  {
    const Built built(builder, frame.inputs);
    ASSERT_TRUE(built.person);
    EXPECT_EQ(built.report.persons, 1);
    EXPECT_EQ(labelled(built, frame, 9, PixelLabel::person), 0);
    EXPECT_GT(labelled(built, frame, 1, PixelLabel::person), 0.9);
    EXPECT_TRUE(built.report.floor_measured) << "the floor is background too, and still measured";
  }
  EXPECT_EQ(Built(builder, before.inputs).report.outcome, CloudOutcome::empty_stage);
  for (int c = 0; c < 4; ++c) builder.set_background(c, {});
  EXPECT_EQ(Built(builder, frame.inputs).report.persons, 2);
  EXPECT_THROW(builder.set_background(4, {}), std::invalid_argument);
  EXPECT_THROW(builder.set_background(0, std::vector<std::uint16_t>(3)), std::invalid_argument);
}

TEST(CloudBuilder, FloorGoesAndShinsStay) {
  for (const float height : {0.0f, 0.03f, -0.04f})
    for (const float slope : {0.0f, 0.012f}) {
      if (height == 0 && slope != 0) continue;  // the other tilted floors say as much
      Scene scene;
      scene.floor_height = height, scene.floor_slope_x = slope;
      scene.noise = 0.003f;
      scene.add_person(0, 0);
      for (auto& part : scene.capsules) part.a.y() += height, part.b.y() += height;
      const auto rig = booth_cameras();
      const BoothFrame frame(scene, rig);
      CloudBuilder builder({}, rig);
      const Built built(builder, frame.inputs);
      ASSERT_TRUE(built.person);
      EXPECT_NEAR(built.report.floor_height, height, 0.003f);
      EXPECT_NEAR(built.report.floor_tilt_x, slope, 0.003f);
      EXPECT_NEAR(built.observation.floor_height, height, 0.003f);
      EXPECT_LT(labelled(built, frame, -1, PixelLabel::person), 0.003);
      // Of the pixels on the legs from 4 cm above the floor to the knee nearly all are the person's.
      int shin = 0, kept = 0;
      for (std::size_t c = 0; c < 4; ++c) {
        const PixelRays rays(rig[c], {});
        for (std::size_t i = 0; i < frame.images[c].depth.size(); ++i) {
          if (frame.images[c].owner[i] != 1) continue;
          const float y = rays.point(i, static_cast<float>(frame.images[c].depth[i]) * 0.001f).y() - height;
          if (y > 0.04f && y < 0.5f) ++shin, kept += built.observation.views[c].label[i] == PixelLabel::person;
        }
      }
      EXPECT_GT(shin, 3000);
      EXPECT_GT(kept, 0.93 * shin) << height << " " << slope;
    }
}

TEST(CloudBuilder, FlyingPixelsAtEdgesAreDropped) {
  Scene scene;
  scene.add_person(0, 0);
  const auto rig = booth_cameras(1);
  BoothFrame frame(scene, rig);
  auto& image = frame.images[0];
  // What a time-of-flight camera sees at an edge: a mixture of both surfaces.
  int mixed = 0;
  std::vector<std::size_t> invented;
  const auto clean = image.depth;
  for (std::size_t i = 1; i + 1 < clean.size(); ++i)
    if (image.owner[i] == 1 && image.owner[i + 1] == 0 && clean[i + 1] > clean[i] + 400) {
      image.depth[i + 1] = static_cast<std::uint16_t>(clean[i] + (clean[i + 1] - clean[i]) / 4 + static_cast<int>(i % 7) * 20);
      invented.push_back(i + 1);
      ++mixed;
    }
  ASSERT_GT(mixed, 100);
  CloudBuilder builder({}, rig);
  const Built built(builder, frame.inputs);
  ASSERT_TRUE(built.person);
  int taken = 0;
  for (const std::size_t i : invented) taken += built.observation.views[0].label[i] == PixelLabel::person;
  EXPECT_LT(taken, mixed / 20);
  EXPECT_GT(built.report.flying + built.report.isolated, mixed / 2);
}

TEST(CloudBuilder, AForearmThatCameOffIsTakenBack) {
  Scene scene;
  scene.add_person(0, 0);
  for (auto& part : scene.capsules)  // the forearms are 18.5 cm further out: a gap of 10.5 cm
    if (part.radius == 0.035f) {
      const Eigen::Vector3f shift(part.a.x() > 0 ? 0.185f : -0.185f, 0, 0);
      part.a += shift, part.b += shift;
      part.owner = 5;
    }
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder whole({}, rig), strict({.rejoin_gap = 0}, rig);
  const Built with(whole, frame.inputs), without(strict, frame.inputs);
  EXPECT_GT(labelled(with, frame, 5, PixelLabel::person), 0.9);
  EXPECT_EQ(with.report.other_components, 0);
  EXPECT_LT(labelled(without, frame, 5, PixelLabel::person), 0.1) << "or the test proves nothing";
}

TEST(CloudBuilder, CrumbsOfTheFloorDoNotJoinTheFeet) {
  Scene scene;
  scene.add_person(0, 0);
  for (const float x : {0.295f, -0.315f})
    scene.capsules.push_back({{x, 0.04f, 0.1f}, {x + 0.02f, 0.04f, 0.12f}, 0.02f, 7});  // within the gap that limbs may have
  scene.noise = 0.003f;
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  const Built built(builder, frame.inputs);
  ASSERT_TRUE(built.person);
  EXPECT_LT(labelled(built, frame, 7, PixelLabel::person), 0.05);
  EXPECT_GT(labelled(built, frame, 1, PixelLabel::person), 0.93);
}

TEST(CloudBuilder, ThinsToTheCapacityEvenly) {
  Scene scene;
  scene.add_person(0, 0);
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  const Built full(builder, frame.inputs), thin(builder, frame.inputs, 1000);
  EXPECT_EQ(thin.report.points, 1000);
  EXPECT_EQ(thin.observation.cloud.size, 1000);
  EXPECT_EQ(thin.report.person, full.report.person);
  std::array<int, 4> of_full{}, of_thin{};
  for (int i = 0; i < full.observation.cloud.size; ++i) ++of_full[full.observation.cloud.camera[static_cast<std::size_t>(i)]];
  for (int i = 0; i < 1000; ++i) ++of_thin[thin.observation.cloud.camera[static_cast<std::size_t>(i)]];
  for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(of_thin[c], of_full[c] * 1000.0 / full.observation.cloud.size, 1.01);
}

bool same(const Observation& a, const Observation& b) {
  const auto equal = [](const auto& u, const auto& v, std::size_t n) { return std::memcmp(u.data(), v.data(), n * sizeof(u[0])) == 0; };
  const auto n = static_cast<std::size_t>(a.cloud.size);
  bool good = a.cloud.size == b.cloud.size && equal(a.cloud.x, b.cloud.x, n) && equal(a.cloud.y, b.cloud.y, n) && equal(a.cloud.z, b.cloud.z, n) &&
              equal(a.cloud.nx, b.cloud.nx, n) && equal(a.cloud.ny, b.cloud.ny, n) && equal(a.cloud.nz, b.cloud.nz, n) &&
              equal(a.cloud.camera, b.cloud.camera, n) && a.floor_height == b.floor_height;
  for (std::size_t v = 0; v < a.views.size(); ++v)
    good = good && equal(a.views[v].depth, b.views[v].depth, a.views[v].depth.size()) && equal(a.views[v].label, b.views[v].label, a.views[v].label.size()) &&
           a.views[v].nearest_dx == b.views[v].nearest_dx && a.views[v].nearest_dy == b.views[v].nearest_dy;
  return good;
}

TEST(CloudBuilder, TheSameBitsForAnyNumberOfThreadsAndAfterAnyHistory) {
  Scene scene, other;
  scene.add_person(0.2f, 0.1f);
  scene.add_chair(-0.9f, 0.2f);
  scene.noise = 0.004f;
  other.add_person(-0.4f, 0.3f);
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig), earlier(other, rig);
  CloudBuilder one({.threads = 1}, rig);
  const Built reference(one, frame.inputs);
  ASSERT_TRUE(reference.person);
  for (const int threads : {1, 2, 4}) {
    CloudBuilder builder({.threads = threads}, rig);
    Observation out = builder.make_observation(120000);
    CloudReport report;
    for (int round = 0; round < 3; ++round) {
      builder.build(earlier.inputs, out, report);
      builder.build(std::span(earlier.inputs).first(2), out, report);
      ASSERT_TRUE(builder.build(frame.inputs, out, report));
      EXPECT_TRUE(same(out, reference.observation)) << threads << " threads, round " << round;
    }
  }
}

TEST(CloudBuilder, AllocatesNothingPerFrame) {
  Scene scene;
  scene.add_person(0, 0);
  scene.add_chair(-0.9f, 0.2f);
  scene.noise = 0.004f;
  const auto rig = booth_cameras();
  const BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  Observation out = builder.make_observation(60000);
  CloudReport report;
  EXPECT_GT(builder.memory_bytes(), 1u << 20);
  const tests::AllocationCount guard;
  ASSERT_TRUE(builder.build(frame.inputs, out, report));  // the first frame too
  builder.build(std::span(frame.inputs).first(1), out, report);
  builder.build({}, out, report);
  EXPECT_EQ(guard.so_far(), 0u);
}

TEST(CloudBuilder, TheSilhouetteMapLeadsToThePerson) {
  Scene scene;
  scene.add_person(0, 0);
  const Built built = build(scene);
  for (const View& view : built.observation.views) {
    std::vector<std::pair<int, int>> person;
    for (int v = 0; v < view.camera.height; ++v)
      for (int u = 0; u < view.camera.width; ++u)
        if (view.label[static_cast<std::size_t>(v * view.camera.width + u)] == PixelLabel::person) person.emplace_back(u, v);
    const int across = silhouette_places(view.camera.width);
    for (std::size_t node = 0; node < view.nearest_dx.size(); node += 37) {
      const int u = static_cast<int>(node) % across * kSilhouetteStep, v = static_cast<int>(node) / across * kSilhouetteStep;
      const int du = view.nearest_dx[node], dv = view.nearest_dy[node];
      ASSERT_EQ(view.label[static_cast<std::size_t>((v + dv) * view.camera.width + u + du)], PixelLabel::person) << "the way must end on the person";
      double exact = 1e9;
      for (const auto& [pu, pv] : person) exact = std::min(exact, std::hypot(pu - u, pv - v));
      EXPECT_LE(std::hypot(du, dv), exact + 3.0);
      const bool inside = view.label[static_cast<std::size_t>(v * view.camera.width + u)] == PixelLabel::person;
      EXPECT_EQ(inside, du == 0 && dv == 0);
    }
  }
}

View outlined(int width, int height) {
  View view;
  view.camera.width = width, view.camera.height = height;
  view.label.assign(static_cast<std::size_t>(width * height), PixelLabel::unknown);
  for (const auto& [u, v] : {std::pair{250, 200}, {251, 203}, {509, 421}, {3, 420}}) view.label[static_cast<std::size_t>(v * width + u)] = PixelLabel::person;
  const auto places = static_cast<std::size_t>(silhouette_places(width) * silhouette_places(height));
  view.nearest_dx.assign(places, kSilhouetteFar);
  view.nearest_dy.assign(places, kSilhouetteFar);
  map_silhouette(view);
  return view;
}

TEST(Silhouette, ImagesThatAreNoWholeNumberOfStepsAreReadToTheirEdges) {
  // The same picture without its last two rows and columns, in which nobody is: as many places, and the same ways from all of them.
  const View whole = outlined(512, 424), cut = outlined(510, 422);
  EXPECT_EQ(whole.nearest_dx, cut.nearest_dx);
  EXPECT_EQ(whole.nearest_dy, cut.nearest_dy);
  EXPECT_EQ(cut.nearest_dx.back(), 1);  // from pixel (508, 420)
  EXPECT_EQ(cut.nearest_dy.back(), 1);
}

}  // namespace
}  // namespace booth::fit
