// The printed board: a chessboard whose cells carry dots, so that a part of it, a turned one and a mirrored print are told apart.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

namespace booth::fit::calibrate {

/// Board frame: origin in the middle, x along the long side (the printed arrow), y up the print, z out of the print towards who looks at it; metres.
/// Laid on the floor with the arrow to the booth's front, it is the booth frame.
struct Board {
  static constexpr int kColumns = 7, kRows = 5;                                 ///< squares
  static constexpr int kCornerColumns = kColumns - 1, kCornerRows = kRows - 1;  ///< inner corners
  static constexpr int kCorners = kCornerColumns * kCornerRows;                 ///< numbered row by row from the top left
  static constexpr double kDotRadius = 0.24;                                    ///< in squares

  double square = 0.108;  ///< metres

  double width() const { return kColumns * square; }
  double height() const { return kRows * square; }
  Eigen::Vector3d corner(int id) const {
    const int column = id % kCornerColumns, row = id / kCornerColumns;
    return {(column + 1 - 0.5 * kColumns) * square, (0.5 * kRows - 1 - row) * square, 0};
  }
  /// Of the cell in this row from the top and column from the left.
  static bool black(int row, int column) { return (row + column) % 2 == 0; }
  /// A dot of the other colour in the middle of the cell.
  static bool dotted(int row, int column);
};

struct Paper {
  const char* name;      ///< "a4" ... "a0"
  double width, height;  ///< millimetres, long side first
  double square;         ///< millimetres
};
/// The papers a board can be printed on; the third, A2, serves booths up to 3 m, larger ones are seen from further away.
const std::vector<Paper>& papers();
/// Null when there is no such paper.
const Paper* find_paper(std::string_view name);

/// A rectangle of cells as a camera sees them, in its own rows and columns: NaN where a cell cannot be judged.
struct CellReading {
  int rows = 0, columns = 0;
  std::vector<double> dark;  ///< > 0: black, < 0: white; row-major
  std::vector<double> dot;   ///< > 0: has a dot, < 0: has none; size 1 when the dot is as strong as the cell's contrast
};

/// Where on the board a reading lies.
struct CellMatch {
  enum class Verdict { board, mirrored, foreign } verdict = Verdict::foreign;
  int quarter_turns = 0;    ///< reading's columns and rows against the board's
  int row = 0, column = 0;  ///< of the board's cell that the reading's first cell is, after turning
  double agreement = 0;     ///< share of the judged cells that agree
  /// The board's cell of the reading's cell (row, column); only where verdict is board.
  std::pair<int, int> cell(const CellReading& reading, int r, int c) const;
};

/// The placement, turn and reflection that explain the reading best. `foreign` unless it explains four fifths of the cells and clearly more than the next.
CellMatch match_cells(const CellReading& reading);

}  // namespace booth::fit::calibrate
