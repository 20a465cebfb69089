// From rendered infrared and depth to cameras: within the limits that an installer was promised, and every mistake of his named.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/daemon/calibrate/rendered_booth.hpp"

namespace booth::tests {
namespace {

using namespace fit::calibrate;
using drivers::ShownBoard;
constexpr double kDegree = EIGEN_PI / 180;
constexpr int kViews = 27;

/// Four cameras 3 m apart, rendered and detected once. Some views are difficult: an arm over the board, glare, or both.
struct Fixture {
  RenderedBooth booth{3, 5, kViews};
  daemon::ViewCollector collector{booth.planned, Board{}};
  int seen = 0, partial = 0;

  Fixture() {
    for (int v = 0; v <= kViews; ++v) {
      const auto report = collector.add(pictures_of(booth.look(v, [&](ShownBoard& s) {
        if (v % 6 == 4) s.hidden = 0.2;
        if (v % 6 == 5) s.glare = 0.5;
      })));
      seen += static_cast<int>(report.seen.size());
    }
    for (const Sighting& s : collector.input().sightings) partial += s.corner.size() < Board::kCorners;
  }
};

const Fixture& shared() {
  static const Fixture fixture;
  return fixture;
}

TEST(RenderedCalibration, FourCamerasThreeMetresApartAreWithinThreeMillimetresAndATenthAndAHalfOfADegree) {
  const Fixture& f = shared();
  const Calibration c = calibrate(f.collector.input());
  ASSERT_TRUE(c.accepted()) << c.sentence;
  double position = 0, angle = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Rigid real = daemon::rigid_of(f.booth.real[i].camera_to_world);
    position = std::max(position, (c.cameras[i].booth_from_camera.translation - real.translation).norm());
    angle = std::max(angle, angle_between(c.cameras[i].booth_from_camera.rotation, real.rotation) / kDegree);
  }
  std::printf("%d sightings (%d partial), %d left out; worst camera %.2f mm, %.3f degrees; held out %.3f px, %.2f mm (p95 %.2f), plane %.2f mm\n", f.seen,
              f.partial, c.left_out, 1000 * position, angle, c.errors.reprojection_px, c.errors.corner_mm, c.errors.corner_p95_mm, c.errors.plane_mm);
  EXPECT_LE(position, 0.003);
  EXPECT_LE(angle, 0.15);
  EXPECT_TRUE(c.origin_from_board);
  EXPECT_GT(f.partial, 0);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(c.cameras[i].depth.read(2) - 2, f.booth.depth_offset[i], 0.006) << i;
}

TEST(RenderedCalibration, APrintThatIsAFewPercentSmallerIsNamedWithItsSize) {
  CalibrationInput in = shared().collector.input();
  in.board.square = 0.108 / 0.96;  // shown: 108 mm; believed: 112.5
  const Calibration c = calibrate(in);
  EXPECT_EQ(c.refusal, Refusal::square_size);
  EXPECT_NEAR(c.square_ratio, 0.96, 0.008);
}

TEST(RenderedCalibration, TwoCamerasInEachOthersPlacesAreNamed) {
  CalibrationInput in = shared().collector.input();
  std::swap(in.expected[1], in.expected[3]);
  EXPECT_THAT(calibrate(in).sentence, testing::StartsWith("back-left and front-right stand in each other's places"));
}

TEST(RenderedCalibration, TooFewViewsSayWhereToHoldTheBoard) {
  CalibrationInput in = shared().collector.input();
  std::erase_if(in.sightings, [](const Sighting& s) { return s.view >= 5; });
  const Calibration c = calibrate(in);
  EXPECT_EQ(c.refusal, Refusal::too_few_views);
  EXPECT_THAT(c.sentence, testing::HasSubstr("hold the board between them"));
}

TEST(RenderedCalibration, ACameraThatWasMovedHalfWayIsNamed) {
  const Fixture& f = shared();
  CalibrationInput in = f.collector.input();
  // front-left was knocked by a degree before view 13: its later pictures are rendered anew.
  std::erase_if(in.sightings, [](const Sighting& s) { return s.camera == 0 && s.view >= 12; });
  auto knocked = f.booth.real[0];
  Rigid pose = daemon::rigid_of(knocked.camera_to_world);
  pose.rotation = rotation_by(Eigen::Vector3d(0, 0, kDegree)) * pose.rotation;
  knocked.camera_to_world = daemon::transform_of(pose);
  drivers::BoardCamera camera(knocked, 0, {.seed = 9, .depth_offset = f.booth.depth_offset[0]});
  for (int v = 12; v <= kViews; ++v) {
    ShownBoard shown;
    shown.booth_from_board = f.booth.places[static_cast<std::size_t>(v)];
    const auto frame = camera.look(shown, static_cast<std::uint64_t>(v));
    auto found = daemon::detect_board({512, 424, frame.infrared});
    if (found.kind != daemon::BoardDetection::Kind::board) continue;
    found.sighting.view = v, found.sighting.camera = 0;
    daemon::add_board_depth({512, 424, frame.depth}, 0.001, in.lenses[0], in.board, found.sighting);
    in.sightings.push_back(found.sighting);
  }
  const Calibration c = calibrate(in);
  EXPECT_EQ(c.refusal, Refusal::camera_moved) << c.sentence;
  EXPECT_THAT(c.sentence, testing::StartsWith("front-left was moved before view 1")) << c.sentence;
}

/// Two views of another sheet, as a whole calibration.
Calibration shown_as(ShownBoard::Print print) {
  RenderedBooth booth(3, 5, 4);
  daemon::ViewCollector collector(booth.planned, Board{});
  for (int v = 0; v < 2; ++v) collector.add(pictures_of(booth.look(v, [&](ShownBoard& s) { s.print = print; })));
  return calibrate(collector.input());
}

TEST(RenderedCalibration, AMirroredPrintIsNamed) {
  const Calibration c = shown_as(ShownBoard::Print::mirrored);
  EXPECT_EQ(c.refusal, Refusal::mirrored_print);
  EXPECT_THAT(c.sentence, testing::StartsWith("the board is printed mirrored"));
}

TEST(RenderedCalibration, AnotherChessboardIsNamed) {
  for (const auto print : {ShownBoard::Print::plain, ShownBoard::Print::other}) {
    const Calibration c = shown_as(print);
    EXPECT_EQ(c.refusal, Refusal::foreign_board) << c.sentence;
    EXPECT_THAT(c.sentence, testing::StartsWith("another board was shown"));
  }
}

TEST(RenderedCalibration, TheNextPlaceIsAPairThatLacksViews) {
  RenderedBooth booth(3, 5, 4);
  daemon::ViewCollector collector(booth.planned, Board{});
  EXPECT_THAT(collector.next_place(), testing::StartsWith("hold the board where two cameras see its print"));
  const auto report = collector.add(pictures_of(booth.look(0)));
  EXPECT_GE(report.seen.size(), 2u);
  EXPECT_FALSE(report.progress.enough);
  EXPECT_THAT(collector.next_place(), testing::StartsWith("hold the board between "));
}

/// An arm over the board and a lamp's image on it cost corners, never their places.
TEST(BoardDetector, GlareAndPartialBoardsLoseCornersAndMoveNone) {
  RenderedBooth booth(3, 5, 4);
  int found = 0, whole = 0;
  for (const auto& [hidden, glare] : {std::pair{0.0, 1.0}, {0.2, 0.0}, {0.4, 0.5}, {0.8, 0.0}}) {
    const auto frames = booth.look(1, [&, h = hidden, g = glare](ShownBoard& s) { s.hidden = h, s.glare = g; });
    for (std::size_t c = 0; c < 4; ++c) {
      const Rigid pose = daemon::rigid_of(booth.real[c].camera_to_world).inverse() * booth.places[1];
      if (pose.rotation.col(2).dot(pose.translation) > -0.3 * pose.translation.norm()) continue;  // seen from behind, or nearly edge on
      const auto seen = daemon::detect_board({512, 424, frames[c].infrared});
      if (hidden > 0.6) {
        EXPECT_NE(seen.kind, daemon::BoardDetection::Kind::board) << "two columns are not enough";
      }
      if (seen.kind != daemon::BoardDetection::Kind::board) continue;
      ++found, whole += seen.sighting.corner.size() == Board::kCorners;
      const Lens lens = daemon::lens_of(booth.real[c].intrinsics);
      for (std::size_t i = 0; i < seen.sighting.corner.size(); ++i) {
        const Eigen::Vector2d truth = lens.project(pose * Board{}.corner(seen.sighting.corner[i]));
        EXPECT_LE((seen.sighting.pixel.col(static_cast<Eigen::Index>(i)) - truth).norm(), 1.0)
            << hidden << ' ' << glare << " corner " << seen.sighting.corner[i];
      }
    }
  }
  EXPECT_GT(found, whole) << "some boards were seen in part";
}

TEST(BoardDetector, AnEmptyRoomAndHostilePicturesHoldNoBoard) {
  std::vector<std::uint16_t> pixels(512 * 424, 0);
  EXPECT_EQ(daemon::detect_board({512, 424, pixels}).kind, daemon::BoardDetection::Kind::none);
  std::fill(pixels.begin(), pixels.end(), std::uint16_t{65535});
  EXPECT_EQ(daemon::detect_board({512, 424, pixels}).kind, daemon::BoardDetection::Kind::none);
  std::uint32_t state = 1;
  for (auto& p : pixels) p = static_cast<std::uint16_t>((state = state * 1664525 + 1013904223) >> 16);
  EXPECT_NE(daemon::detect_board({512, 424, pixels}).kind, daemon::BoardDetection::Kind::board);
  EXPECT_THROW(daemon::detect_board({512, 423, pixels}), std::invalid_argument);
  EXPECT_THROW(daemon::detect_board({8, 8, std::span(pixels).first(64)}), std::invalid_argument);
}

}  // namespace
}  // namespace booth::tests
