// Calibrations of which the truth is known: they are as good as they say, and bad ones are refused with the reason.
#include "fit/calibrate/calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "tests/fit/calibrate/board_booth.hpp"

namespace booth::tests {
namespace {

using namespace fit::calibrate;
constexpr double kDegree = EIGEN_PI / 180;

struct Worst {
  double position = 0, angle = 0;  // metres, degrees
};

/// Of cameras in the booth frame, or, with `relative`, against the first camera.
Worst worst(const Calibration& c, const BoardBooth& truth, bool relative) {
  Worst out;
  for (std::size_t i = 0; i < c.cameras.size(); ++i) {
    const Rigid found = relative ? c.cameras[0].booth_from_camera.inverse() * c.cameras[i].booth_from_camera : c.cameras[i].booth_from_camera;
    const Rigid real = relative ? truth.booth_from_camera[0].inverse() * truth.booth_from_camera[i] : truth.booth_from_camera[i];
    out.position = std::max(out.position, (found.translation - real.translation).norm());
    out.angle = std::max(out.angle, angle_between(found.rotation, real.rotation) / kDegree);
  }
  return out;
}

TEST(Calibration, FourCamerasThreeMetresApartAreWithinThreeMillimetresAndATenthAndAHalfOfADegree) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    BoardBooth truth;
    const auto in = show_boards({.seed = seed}, truth);
    const Calibration c = calibrate(in);
    ASSERT_TRUE(c.accepted()) << c.sentence;
    const Worst booth = worst(c, truth, false), relative = worst(c, truth, true);
    RecordProperty("position_mm_" + std::to_string(seed), std::to_string(1000 * booth.position));
    std::printf("seed %u: booth %.2f mm %.3f deg, relative %.2f mm %.3f deg; held out %.3f px, %.2f mm (p95 %.2f), plane %.2f mm; sd %.2f mm %.3f deg\n", seed,
                1000 * booth.position, booth.angle, 1000 * relative.position, relative.angle, c.errors.reprojection_px, c.errors.corner_mm,
                c.errors.corner_p95_mm, c.errors.plane_mm, c.cameras[2].position_sd_mm, c.cameras[2].angle_sd_deg);
    EXPECT_LE(booth.position, 0.003);
    EXPECT_LE(booth.angle, 0.15);
    EXPECT_TRUE(c.origin_from_board);
    EXPECT_GE(c.errors.views, 15);
  }
}

TEST(Calibration, WithoutABoardOnTheFloorTheLayoutGivesTheFrame) {
  BoardBooth truth;
  const auto in = show_boards({.on_floor = false}, truth);
  const Calibration c = calibrate(in);
  ASSERT_TRUE(c.accepted()) << c.sentence;
  EXPECT_FALSE(c.origin_from_board);
  EXPECT_LE(worst(c, truth, true).position, 0.003);
  // Cameras hang up to 10 cm beside the plan.
  EXPECT_LE(worst(c, truth, false).position, 0.3);
  for (std::size_t i = 0; i < 4; ++i)  // the floor is known, whatever the plan says
    EXPECT_NEAR(c.cameras[i].booth_from_camera.translation.z(), truth.booth_from_camera[i].translation.z(), 0.003);
}

TEST(Calibration, DepthOffsetsAreFoundWithinAFewMillimetres) {
  BoardBooth truth;
  const auto in = show_boards({.views = 40}, truth);
  const Calibration c = calibrate(in);
  ASSERT_TRUE(c.accepted()) << c.sentence;
  for (std::size_t i = 0; i < 4; ++i)
    for (const double z : {1.5, 2.0, 2.5})
      EXPECT_NEAR(c.cameras[i].depth.true_depth(truth.depth[i].read(z)), z, 0.004) << "camera " << i << " at " << z << " m";
}

TEST(Calibration, ItsOwnErrorAndDeviationsTellTheTruth) {
  // Twice the noise: the figures that are stored rise with it.
  BoardBooth truth;
  const Calibration quiet = calibrate(show_boards({.corner_noise = 0.1}, truth)), loud = calibrate(show_boards({.corner_noise = 0.3}, truth));
  ASSERT_TRUE(quiet.accepted()) << quiet.sentence;
  ASSERT_TRUE(loud.accepted()) << loud.sentence;
  EXPECT_NEAR(quiet.errors.reprojection_px, 0.1 * std::sqrt(2.0), 0.04);
  EXPECT_NEAR(loud.errors.reprojection_px, 0.3 * std::sqrt(2.0), 0.1);
  EXPECT_GT(loud.cameras[2].position_sd_mm, 1.5 * quiet.cameras[2].position_sd_mm);
  // Deviations against errors, over many booths: neither boastful nor timid.
  double squares = 0, expected = 0;
  for (unsigned seed = 11; seed < 21; ++seed) {
    const Calibration c = calibrate(show_boards({.corner_noise = 0.2, .seed = seed}, truth));
    ASSERT_TRUE(c.accepted()) << c.sentence;
    for (std::size_t i = 1; i < 4; ++i) {
      const Rigid found = c.cameras[0].booth_from_camera.inverse() * c.cameras[i].booth_from_camera,
                  real = truth.booth_from_camera[0].inverse() * truth.booth_from_camera[i];
      squares += (found.translation - real.translation).squaredNorm() * 1e6;
      expected += c.cameras[i].position_sd_mm * c.cameras[i].position_sd_mm;
    }
  }
  std::printf("ratio of squared errors to variances: %.2f\n", squares / expected);
  EXPECT_GT(squares, 0.3 * expected);
  EXPECT_LT(squares, 3 * expected);
}

TEST(Calibration, AWrongSquareSizeIsNamedWithTheRightOne) {
  BoardBooth truth;
  const Calibration c = calibrate(show_boards({.square = 0.108 * 0.95}, truth));
  EXPECT_EQ(c.refusal, Refusal::square_size);
  EXPECT_THAT(c.sentence, testing::HasSubstr("not 108.0"));
  EXPECT_NEAR(c.square_ratio, 0.95, 0.006);
}

TEST(Calibration, TwoCamerasInEachOthersPlacesAreNamed) {
  BoardBooth truth;
  for (const auto& [a, b] : {std::pair<std::size_t, std::size_t>{0, 1}, {0, 2}, {1, 3}}) {
    auto in = show_boards({}, truth);
    std::swap(in.expected[a], in.expected[b]);
    const Calibration c = calibrate(in);
    EXPECT_EQ(c.refusal, Refusal::cameras_swapped) << c.sentence;
    EXPECT_THAT(c.sentence, testing::StartsWith(in.names[a] + " and " + in.names[b] + " stand in each other's places"));
  }
  // Without a board on the floor nobody knows the front, and one diagonal looks like the other.
  auto in = show_boards({.on_floor = false}, truth);
  std::swap(in.expected[0], in.expected[2]);
  EXPECT_THAT(calibrate(in).sentence, testing::StartsWith("front-left and back-right, or back-left and front-right stand"));
}

TEST(Calibration, TooFewViewsSayWhichPairIsWeakest) {
  BoardBooth truth;
  const Calibration c = calibrate(show_boards({.views = 8}, truth));
  EXPECT_EQ(c.refusal, Refusal::too_few_views);
  EXPECT_THAT(c.sentence, testing::HasSubstr("needed are 10; weakest are "));
}

TEST(Calibration, ACameraThatWasMovedHalfWayIsNamedWithTheView) {
  BoardBooth truth;
  (void)show_boards({}, truth);
  const Rigid before = truth.booth_from_camera[2];
  for (const auto& [turn, shift] : {std::pair{1.0, 0.0}, {0.0, 0.02}, {0.5, 0.01}}) {
    const Move move{2, 10, {rotation_by(Eigen::Vector3d(0, 0, turn * kDegree)) * before.rotation, before.translation + Eigen::Vector3d(shift, 0, 0)}};
    const Calibration c = calibrate(show_boards({}, truth, &move));
    std::printf("%s\n", c.sentence.c_str());
    EXPECT_EQ(c.refusal, Refusal::camera_moved) << c.sentence;
    EXPECT_THAT(c.sentence, testing::StartsWith("back-right was moved before view "));
  }
}

TEST(Calibration, AFewMisreadPicturesAreLeftOut) {
  BoardBooth truth;
  auto in = show_boards({}, truth);
  for (const std::size_t i : {3u, 17u}) in.sightings[i].pixel.row(0).array() += 9;
  const Calibration c = calibrate(in);
  ASSERT_TRUE(c.accepted()) << c.sentence << ' ' << c.left_out;
  EXPECT_GE(c.left_out, 2);
  EXPECT_LE(c.left_out, 4);
  EXPECT_LE(worst(c, truth, false).position, 0.003);
}

/// Everything that an installer can do wrong, in one table, with the sentence that he reads. Rendered pictures of the same: rendered_calibration_test.
TEST(Calibration, EachMistakeHasItsSentence) {
  const auto nothing = [](CalibrationInput&) {};
  const auto turned = [](const BoardBooth& truth) {
    return Move{2, 10, {rotation_by(Eigen::Vector3d(0, 0, kDegree)) * truth.booth_from_camera[2].rotation, truth.booth_from_camera[2].translation}};
  };
  const struct {
    const char* mistake;
    BoardBoothSettings booth;
    bool moved;
    std::function<void(CalibrationInput&)> change;
    Refusal refusal;
    const char* sentence;
  } rows[] = {
      {"a mirrored print",
       {},
       false,
       [](CalibrationInput& in) { in.sightings.clear(), in.mirrored_pictures = 20; },
       Refusal::mirrored_print,
       "the board is printed mirrored (seen so in 20 pictures)"},
      {"another chessboard",
       {},
       false,
       [](CalibrationInput& in) { in.sightings.clear(), in.foreign_pictures = 20; },
       Refusal::foreign_board,
       "another board was shown"},
      {"nothing shown", {}, false, [](CalibrationInput& in) { in.sightings.clear(); }, Refusal::no_board, "no camera saw the board"},
      {"squares of another size", {.square = 0.1}, false, nothing, Refusal::square_size, "by depth the board's squares measure 100"},
      {"two serials exchanged",
       {},
       false,
       [](CalibrationInput& in) { std::swap(in.expected[1], in.expected[2]); },
       Refusal::cameras_swapped,
       "back-left and back-right stand in each other's places"},
      {"too few views", {.views = 5}, false, nothing, Refusal::too_few_views, "too few views: "},
      {"a camera that sees nothing",
       {},
       false,
       [](CalibrationInput& in) { std::erase_if(in.sightings, [](const Sighting& s) { return s.camera == 3; }); },
       Refusal::too_few_views,
       "too few views: "},
      {"a camera knocked half-way", {}, true, nothing, Refusal::camera_moved, "back-right was moved before view "},
      {"glare and blur that move corners", {.corner_noise = 1.2}, false, nothing, Refusal::inaccurate, "measured on views that were held out, corners are "},
      {"boards of which hardly anything is seen",
       {},
       false,
       [](CalibrationInput& in) {
         for (Sighting& s : in.sightings)
           s.corner.resize(std::min<std::size_t>(s.corner.size(), 4)), s.pixel.conservativeResize(2, std::min<Eigen::Index>(s.pixel.cols(), 4));
       },
       Refusal::no_board,
       "no camera saw the board"},
      {"a stage full of things",
       {},
       false,
       [](CalibrationInput& in) {
         for (auto& r : in.room) r.clear();
       },
       Refusal::no_floor,
       "no floor was found"},
      {"neither a plan nor a board on the floor",
       {.on_floor = false},
       false,
       [](CalibrationInput& in) { in.expected.clear(); },
       Refusal::no_floor,
       "nothing says where the stage's middle is"},
  };
  for (const auto& row : rows) {
    BoardBooth truth;
    if (row.moved) (void)show_boards(row.booth, truth);
    const Move move = row.moved ? turned(truth) : Move{};
    CalibrationInput in = show_boards(row.booth, truth, row.moved ? &move : nullptr);
    row.change(in);
    const Calibration c = calibrate(in);
    EXPECT_EQ(to_string(c.refusal), std::string(to_string(row.refusal))) << row.mistake << ": " << c.sentence;
    EXPECT_THAT(c.sentence, testing::StartsWith(row.sentence)) << row.mistake;
  }
}

TEST(Calibration, PicturesWithoutAnyUseAreRefusedWithTheReason) {
  CalibrationInput in;
  in.names = {"a", "b"};
  in.lenses = {kinect_lens(), kinect_lens()};
  EXPECT_EQ(calibrate(in).refusal, Refusal::no_board);
  in.foreign_pictures = 5;
  EXPECT_EQ(calibrate(in).refusal, Refusal::foreign_board);
  in.mirrored_pictures = 5;
  EXPECT_EQ(calibrate(in).refusal, Refusal::mirrored_print);
}

TEST(Calibration, InputThatContradictsItselfIsAnError) {
  BoardBooth truth;
  auto in = show_boards({}, truth);
  in.sightings[0].corner[0] = 99;
  EXPECT_THROW(calibrate(in), std::invalid_argument);
  in = show_boards({}, truth);
  in.names.pop_back();
  EXPECT_THROW(calibrate(in), std::invalid_argument);
}

TEST(Verification, OneViewTellsAKnockedCameraFromAGoodOne) {
  BoardBooth truth;
  const Calibration c = calibrate(show_boards({}, truth));
  ASSERT_TRUE(c.accepted()) << c.sentence;
  BoardBooth again;
  auto later = show_boards({}, again);
  const auto only = [&](int view) {
    auto in = later;
    std::erase_if(in.sightings, [&](const Sighting& s) { return s.view != view; });
    return in;
  };
  const Verification good = verify(only(6), c.cameras);
  EXPECT_TRUE(good.good) << good.sentence;
  auto knocked = c.cameras;
  auto& turned = knocked[static_cast<std::size_t>(only(6).sightings[0].camera)].booth_from_camera;
  turned.rotation = rotation_by(Eigen::Vector3d(0, 0, kDegree)) * turned.rotation;
  const Verification bad = verify(only(6), knocked);
  EXPECT_FALSE(bad.good) << bad.sentence;
}

}  // namespace
}  // namespace booth::tests
