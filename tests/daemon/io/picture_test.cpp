// Drawings land where they should, and PNG files read back to the same pixels.
#include "daemon/io/picture.hpp"

#include <gmock/gmock.h>
#include <png.h>

#include "daemon/io/fit_picture.hpp"
#include "daemon/io/png_image.hpp"
#include "tests/daemon/io/scratch_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {

// Found by gtest's comparisons.
bool operator==(Colour a, Colour b) { return a.red == b.red && a.green == b.green && a.blue == b.blue; }

namespace {

using tests::message_of;
using tests::ScratchFolder;

constexpr Colour kWhite{255, 255, 255}, kBlack{0, 0, 0}, kRed{200, 0, 0};

TEST(Png, ReadsBackTheSamePixels) {
  ScratchFolder folder;
  Picture p(37, 21, {1, 2, 3});
  p.line(2, 3, 30, 18, 3, kRed);
  write_png(folder / "p.png", p);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_file(&image, (folder / "p.png").c_str()), 0) << image.message;
  image.format = PNG_FORMAT_RGB;
  ASSERT_EQ(image.width, 37u);
  ASSERT_EQ(image.height, 21u);
  std::vector<Colour> pixels(37 * 21);
  ASSERT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  EXPECT_TRUE(pixels == p.pixels());
  EXPECT_EQ(folder.entries(), 1u);
  EXPECT_NE(message_of([&] { write_png(folder / "no" / "p.png", p); }), "");
}

TEST(Picture, DrawsLinesWhereTheyAreAndClipsThem) {
  Picture p(20, 20);
  p.line(5, 10, 15, 10, 1, kWhite);
  EXPECT_EQ(p.at(10, 10), kWhite);
  EXPECT_EQ(p.at(10, 12), kBlack);
  EXPECT_EQ(p.at(2, 10), kBlack);
  p.line(-1e4f, -1e4f, 1e4f, 1e4f, 1, kRed);
  EXPECT_EQ(p.at(0, 0), kRed);
  const auto before = p.pixels();
  p.line(std::nanf(""), 0, 1e30f, 1, 1, kRed);
  EXPECT_TRUE(before == p.pixels());
}

TEST(Picture, TurnsClockwise) {
  Picture p(3, 2);
  p.set(0, 0, kRed);  // top left
  EXPECT_EQ(p.rotated(90).at(1, 0), kRed) << "top right";
  EXPECT_EQ(p.rotated(180).at(2, 1), kRed) << "bottom right";
  EXPECT_EQ(p.rotated(270).at(0, 2), kRed) << "bottom left";
  EXPECT_EQ(p.rotated(90).width(), 2);
  EXPECT_TRUE(p.rotated(90).rotated(270).pixels() == p.pixels());
  EXPECT_THROW(p.rotated(45), std::invalid_argument);
}

TEST(Picture, LettersAreLegible) {
  Picture p(12, 9);
  p.text(1, 1, "L", kWhite, 1);
  for (int y = 1; y <= 7; ++y) EXPECT_EQ(p.at(1, y), kWhite);
  for (int x = 1; x <= 5; ++x) EXPECT_EQ(p.at(x, 7), kWhite);
  EXPECT_EQ(p.at(4, 3), kBlack);
  Picture q(12, 9);
  q.text(1, 1, "l", kWhite, 1);
  EXPECT_TRUE(p.pixels() == q.pixels()) << "lower case is drawn as capitals";
}

TEST(Picture, RefusesAbsurdSizes) {
  EXPECT_THROW(Picture(0, 5), std::invalid_argument);
  EXPECT_THROW(Picture(5, 20000), std::invalid_argument);
}

/// Two metres in front of the person (z = 2), one metre above the floor, looking back at her: her left (+x) is on the picture's right.
fit::Camera front_camera() {
  fit::Camera c;
  c.width = 200, c.height = 200;
  c.fx = c.fy = 100;
  c.cx = c.cy = 99.5f;
  c.rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  c.translation = -c.rotation * Eigen::Vector3f(0, 1, 2);
  return c;
}

TEST(Overlay, ProjectsTheSkeletonOntoTheRightPixels) {
  const fit::Camera camera = front_camera();
  const std::vector<std::uint16_t> depth(200 * 200, 2000);
  // Every joint in one place, half a metre to the left of the person: the whole skeleton is one dot.
  const fit::Points3 joints = Eigen::Vector3d(0.5, 1.25, 0).replicate<1, fit::kJoints>();
  const Picture p = draw_overlay(depth, camera, {}, {}, &joints, "", {.scale = 1});
  const Picture plain = draw_depth(depth, 200, 200);
  // x = 99.5 + 100 * 0.5 / 2 = 124.5 (a mirrored picture would have it at 74.5); y = 99.5 - 100 * 0.25 / 2 = 87.
  int changed = 0;
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 200; ++x)
      if (!(p.at(x, y) == plain.at(x, y))) {
        ++changed;
        EXPECT_NEAR(x, 124.5, 3);
        EXPECT_NEAR(y, 87, 3);
      }
  EXPECT_GT(changed, 4);
}

TEST(Overlay, HidesTheFarSideOfTheMeshAndTurnsThePictureUpright) {
  const fit::Camera camera = front_camera();
  const std::vector<std::uint16_t> depth(200 * 200, 3000);
  // Two squares, one behind the other and facing the camera; only the near one's colour may show where both are.
  fit::Vertices v(3, 8);
  v << -0.5f, 0.5f, 0.5f, -0.5f, -0.9f, 0.9f, 0.9f, -0.9f,  //
      0.5f, 0.5f, 1.5f, 1.5f, 0.1f, 0.1f, 1.9f, 1.9f,       //
      0, 0, 0, 0, -1, -1, -1, -1;
  fit::Faces near(3, 2), both(3, 4);
  near << 0, 0, 1, 2, 2, 3;
  both << 0, 0, 4, 4, 1, 2, 5, 6, 2, 3, 6, 7;
  const OverlayStyle style{.rotation = 0, .scale = 1, .mesh_opacity = 1, .skeleton = false};
  const Picture one = draw_overlay(depth, camera, v, near, nullptr, "", style), two = draw_overlay(depth, camera, v, both, nullptr, "", style);
  EXPECT_EQ(one.at(99, 99), two.at(99, 99));
  EXPECT_FALSE(one.at(99, 72) == two.at(99, 72)) << "the far square reaches above the near one";
  EXPECT_EQ(draw_overlay(depth, camera, v, both, nullptr, "", {.rotation = 90, .scale = 1, .mesh_opacity = 1}).pixels().size(), 40000u);
  EXPECT_THROW(draw_overlay(std::span(depth).first(10), camera, v, both, nullptr, "", style), std::invalid_argument);
}

TEST(Overlay, VerticesBehindTheCameraDrawNothing) {
  const fit::Camera camera = front_camera();
  const std::vector<std::uint16_t> depth(200 * 200, 3000);
  const auto model = tests::capsule_body();
  fit::Vertices v;
  model->shaped(fit::ShapeVector(), v);
  v.row(2).array() += 10;
  const Picture p = draw_overlay(depth, camera, v, model->data().faces, nullptr, "", {.scale = 1});
  EXPECT_TRUE(p.pixels() == draw_depth(depth, 200, 200).pixels());
}

TEST(Scene, ShowsABodyFromAnySide) {
  const auto model = tests::capsule_body();
  fit::Vertices v;
  model->shaped(fit::ShapeVector(), v);
  const std::vector<SceneItem> items{{v, &model->data().faces}};
  const auto width_drawn = [&](Eigen::Vector3f from) {
    const Picture p = draw_scene(items, "", {.width = 300, .height = 400, .from = from, .metres_high = 2.2f, .background = kWhite});
    int left = 300, right = 0;
    for (int y = 0; y < 400; ++y)
      for (int x = 0; x < 300; ++x)
        if (!(p.at(x, y) == kWhite)) left = std::min(left, x), right = std::max(right, x);
    return right - left;
  };
  const float metres = v.row(0).maxCoeff() - v.row(0).minCoeff();
  EXPECT_NEAR(width_drawn({0, 0, 1}), metres / 2.2f * 400, 3) << "from the front, arms and all";
  EXPECT_LT(width_drawn({1, 0, 0}), 0.5f * width_drawn({0, 0, 1})) << "narrow from the side";
  EXPECT_GT(width_drawn({0, 1, 0}), 10) << "from above";
}

TEST(Heat, GoesFromBlueToRed) {
  EXPECT_GT(heat(0, 1).blue, heat(0, 1).red);
  EXPECT_GT(heat(5, 1).red, 2 * heat(5, 1).blue);
  EXPECT_EQ(heat(std::nanf(""), 1), heat(0, 1));
}

}  // namespace
}  // namespace booth::daemon
