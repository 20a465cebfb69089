// The pieces of a calibration: lens, board, poses, graph, derivatives.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "fit/calibrate/bundle.hpp"
#include "fit/calibrate/stage.hpp"
#include "tests/fit/calibrate/board_booth.hpp"

namespace booth::tests {
namespace {

using namespace fit::calibrate;

TEST(Lens, DerivativesAreThoseOfDifferences) {
  const Lens lens = kinect_lens();
  const Eigen::Vector3d p(0.4, -0.3, 1.7);
  Eigen::Matrix<double, 2, 3> slope;
  const Eigen::Vector2d at = lens.project(p, &slope);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(i);
    const Eigen::Vector2d difference = (lens.project(p + step) - lens.project(p - step)) / 2e-6;
    EXPECT_NEAR((difference - slope.col(i)).norm(), 0, 1e-5) << i;
  }
  EXPECT_NEAR((lens.ray(at) - p.head<2>() / p.z()).norm(), 0, 1e-9);
}

/// What a camera reads of the board's cells [row, row + rows) x [column, column + columns), turned clockwise by quarter turns or mirrored.
CellReading reading(int row, int column, int rows, int columns, int turns, bool mirrored) {
  CellReading r{rows, columns, {}, {}};
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const int c = column + (mirrored ? columns - 1 - j : j);
      r.dark.push_back(Board::black(row + i, c) ? 1 : -1);
      r.dot.push_back(Board::dotted(row + i, c) ? 1 : -1);
    }
  for (int t = 0; t < turns; ++t) {
    CellReading next{r.columns, r.rows, {}, {}};
    for (int i = 0; i < next.rows; ++i)
      for (int j = 0; j < next.columns; ++j) {
        const auto from = static_cast<std::size_t>((r.rows - 1 - j) * r.columns + i);
        next.dark.push_back(r.dark[from]), next.dot.push_back(r.dot[from]);
      }
    r = next;
  }
  return r;
}

TEST(Board, AnyPartOfItIsPlacedWhateverWayItIsTurned) {
  for (const auto& [rows, columns] : {std::pair{5, 7}, {4, 5}, {5, 4}})
    for (int row = 0; row + rows <= Board::kRows; ++row)
      for (int column = 0; column + columns <= Board::kColumns; ++column)
        for (int turns = 0; turns < 4; ++turns) {
          const CellReading r = reading(row, column, rows, columns, turns, false);
          const CellMatch m = match_cells(r);
          ASSERT_EQ(m.verdict, CellMatch::Verdict::board);
          // Each cell is found again.
          for (int i = 0; i < r.rows; ++i)
            for (int j = 0; j < r.columns; ++j) {
              const auto [br, bc] = m.cell(r, i, j);
              const auto k = static_cast<std::size_t>(i * r.columns + j);
              ASSERT_GE(br, row);
              ASSERT_LT(br, row + rows);
              ASSERT_GE(bc, column);
              ASSERT_LT(bc, column + columns);
              EXPECT_EQ(Board::dotted(br, bc), r.dot[k] > 0);
              EXPECT_EQ(Board::black(br, bc), r.dark[k] > 0);
            }
          EXPECT_EQ(match_cells(reading(row, column, rows, columns, turns, true)).verdict, CellMatch::Verdict::mirrored);
        }
}

TEST(Board, TheSmallestPartSurvivesOneWrongCellAndTwoUnreadable) {
  CellReading r = reading(1, 1, 4, 5, 2, false);
  r.dot[3] *= -1;
  r.dot[7] = r.dark[12] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(match_cells(r).verdict, CellMatch::Verdict::board);
}

TEST(Board, OtherChessboardsAreForeign) {
  CellReading plain = reading(0, 0, 5, 7, 0, false);
  for (double& d : plain.dot) d = -1;
  EXPECT_EQ(match_cells(plain).verdict, CellMatch::Verdict::foreign);
  CellReading larger{6, 9, std::vector<double>(54, 1), std::vector<double>(54, -1)};
  for (int i = 0; i < 54; ++i) larger.dark[static_cast<std::size_t>(i)] = (i / 9 + i % 9) % 2 == 0 ? 1 : -1;
  EXPECT_EQ(match_cells(larger).verdict, CellMatch::Verdict::foreign);
}

TEST(BoardPose, IsExactWithoutNoiseAndTheFlippedOneIsNotTaken) {
  BoardBooth truth;
  const auto in = show_boards({.corner_noise = 0, .depth_noise = 0}, truth);
  for (const Sighting& s : in.sightings) {
    const auto pose = pose_of_board(in.lenses[0], in.board, s);
    ASSERT_TRUE(pose);
    const Rigid real = truth.booth_from_camera[static_cast<std::size_t>(s.camera)].inverse() * truth.booth_from_board[static_cast<std::size_t>(s.view)];
    EXPECT_NEAR((pose->camera_from_board.translation - real.translation).norm(), 0, 1e-5);
    EXPECT_NEAR(angle_between(pose->camera_from_board.rotation, real.rotation), 0, 1e-4);
  }
}

TEST(BoardPose, CornersOnALineGiveNone) {
  BoardBooth truth;
  auto in = show_boards({}, truth);
  Sighting s = in.sightings[0];
  s.corner.resize(6);
  s.pixel = Eigen::Matrix2Xd(in.sightings[0].pixel.leftCols(6));
  EXPECT_FALSE(pose_of_board(in.lenses[0], in.board, s));
}

TEST(BoardPose, StrayCornersAreDroppedAndNoOthers) {
  BoardBooth truth;
  const auto in = show_boards({.corner_noise = 0.15}, truth);
  for (std::size_t k = 0; k < 8; ++k) {
    Sighting s = in.sightings[k];
    const std::size_t whole = s.corner.size(), least = whole / 2;
    EXPECT_EQ(drop_strays(in.lenses[0], in.board, 1.0, least, s), 0);
    const std::vector<int> strays{s.corner[2], s.corner[whole - 3]};
    s.pixel.col(2) += Eigen::Vector2d(0.6, -2.4);
    s.pixel.col(static_cast<Eigen::Index>(whole) - 3) += Eigen::Vector2d(-1.8, 0.4);
    EXPECT_EQ(drop_strays(in.lenses[0], in.board, 1.0, least, s), 2);
    ASSERT_EQ(s.corner.size(), whole - 2);
    for (const int stray : strays) EXPECT_EQ(std::count(s.corner.begin(), s.corner.end(), stray), 0);
    ASSERT_EQ(s.pixel.cols(), static_cast<Eigen::Index>(s.corner.size()));
    EXPECT_LT(pose_of_board(in.lenses[0], in.board, s)->rms_px, 0.3);
    for (Eigen::Index i = 0; i < s.pixel.cols(); ++i) s.pixel.col(i) += Eigen::Vector2d((i * 7 % 5 - 2) * 3.0, (i * 3 % 7 - 3) * 3.0);
    drop_strays(in.lenses[0], in.board, 1.0, least, s);
    EXPECT_GE(s.corner.size(), least) << "where nothing fits, as many stay as were asked for";
  }
}

TEST(Bundle, TheSolutionIsAMinimumInEveryDirection) {
  // The derivatives are right if no small step in any unknown lowers the cost at the end.
  BoardBooth truth;
  const auto in = show_boards({.views = 12}, truth);
  BundleState x;
  for (const Rigid& c : truth.booth_from_camera) x.camera.push_back(c.inverse() * truth.booth_from_camera[0]);
  for (const Rigid& b : truth.booth_from_board) x.board.push_back(truth.booth_from_camera[0].inverse() * b);
  x.depth.resize(4);
  const BundleReport solved = adjust(in.lenses, in.board, in.sightings, in.bundle, {}, x);
  EXPECT_TRUE(solved.converged);
  BundleSettings look = in.bundle;
  look.iterations = 0;
  const auto cost = [&](const BundleState& at) {
    BundleState copy = at;
    return adjust(in.lenses, in.board, in.sightings, look, {}, copy).cost;
  };
  for (int unknown = 0; unknown < 8; ++unknown)
    for (const double sign : {-1.0, 1.0})
      for (std::size_t camera = 0; camera < 4; ++camera) {
        BundleState off = x;
        if (unknown < 6 && camera > 0) off.camera[camera] = stepped(off.camera[camera], sign * 2e-5 * Vector6::Unit(unknown));
        if (unknown == 6) off.depth[camera].gain += sign * 2e-5;
        if (unknown == 7) off.depth[camera].offset += sign * 2e-5;
        EXPECT_GE(cost(off), solved.cost - 1e-6) << "camera " << camera << " unknown " << unknown;
      }
  for (int unknown = 0; unknown < 6; ++unknown) {
    BundleState off = x;
    off.board[3] = stepped(off.board[3], 2e-5 * Vector6::Unit(unknown));
    EXPECT_GE(cost(off), solved.cost - 1e-6) << "board " << unknown;
  }
}

TEST(Floor, ATableIsNoFloorAndNeitherIsAWall) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 2000; ++i) points.emplace_back(2 * u(random), 2 * u(random), 0.004 * u(random));
  for (int i = 0; i < 3000; ++i) points.emplace_back(0.6 * u(random), 0.6 * u(random), 0.7 + 0.004 * u(random));
  for (int i = 0; i < 4000; ++i) points.emplace_back(2, 2 * u(random), 1 + u(random));
  const std::vector<Eigen::Vector3d> cameras{{1.5, 1.5, 1.6}, {-1.5, 1.5, 1.6}};
  const auto floor = find_floor(points, Eigen::Vector3d(0.1, 0, 1).normalized(), cameras);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->plane.height, 0, 0.002);
  EXPECT_GT(floor->plane.normal.z(), std::cos(0.003));
}

TEST(Floor, NobodyFindsOneInAWallAlone) {
  std::vector<Eigen::Vector3d> points;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 4000; ++i) points.emplace_back(2 + 0.004 * u(random), 2 * u(random), 1 + u(random));
  EXPECT_FALSE(find_floor(points, Eigen::Vector3d::UnitZ(), {}));
}

}  // namespace
}  // namespace booth::tests
