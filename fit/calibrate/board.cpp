// The dots were searched for by computer: any 4 x 3 corners of the board, turned or mirrored, differ from any others in at least 7 of their 20 cells.
#include "fit/calibrate/board.hpp"

#include <array>
#include <cmath>

namespace booth::fit::calibrate {
namespace {

constexpr std::array<const char*, Board::kRows> kDots{"#..#.#.", "#....##", "#####..", "###..#.", ".##...."};

/// A reading turned by quarter turns, after its columns were reversed when `mirrored`: cell (r, c) of the turned one is this cell of the reading.
std::pair<int, int> source_of(int rows, int columns, int turns, bool mirrored, int r, int c) {
  int height = turns % 2 == 0 ? rows : columns, width = turns % 2 == 0 ? columns : rows;
  for (int k = 0; k < turns; ++k) {
    // Undo one clockwise turn.
    const int old_r = width - 1 - c, old_c = r;
    r = old_r, c = old_c;
    std::swap(width, height);
  }
  return {r, mirrored ? columns - 1 - c : c};
}

struct Score {
  int agree = 0, judged = 0;
};

Score score(const CellReading& reading, int turns, bool mirrored, int row, int column) {
  const int height = turns % 2 == 0 ? reading.rows : reading.columns, width = turns % 2 == 0 ? reading.columns : reading.rows;
  Score out;
  for (int r = 0; r < height; ++r)
    for (int c = 0; c < width; ++c) {
      const auto [sr, sc] = source_of(reading.rows, reading.columns, turns, mirrored, r, c);
      const auto i = static_cast<std::size_t>(sr * reading.columns + sc);
      if (std::isnan(reading.dark[i]) || std::isnan(reading.dot[i])) continue;
      ++out.judged;
      out.agree += (reading.dark[i] > 0) == Board::black(row + r, column + c) && (reading.dot[i] > 0) == Board::dotted(row + r, column + c);
    }
  return out;
}

}  // namespace

bool Board::dotted(int row, int column) { return kDots[static_cast<std::size_t>(row)][column] == '#'; }

const std::vector<Paper>& papers() {
  static const std::vector<Paper> all{{"a4", 297, 210, 37}, {"a3", 420, 297, 54}, {"a2", 594, 420, 76}, {"a1", 841, 594, 108}, {"a0", 1189, 841, 152}};
  return all;
}

const Paper* find_paper(std::string_view name) {
  for (const Paper& p : papers())
    if (name == p.name) return &p;
  return nullptr;
}

std::pair<int, int> CellMatch::cell(const CellReading& reading, int r, int c) const {
  // The turned cell whose source is (r, c): few enough to look through.
  const int height = quarter_turns % 2 == 0 ? reading.rows : reading.columns, width = quarter_turns % 2 == 0 ? reading.columns : reading.rows;
  for (int tr = 0; tr < height; ++tr)
    for (int tc = 0; tc < width; ++tc)
      if (source_of(reading.rows, reading.columns, quarter_turns, false, tr, tc) == std::pair(r, c)) return {row + tr, column + tc};
  return {-1, -1};
}

CellMatch match_cells(const CellReading& reading) {
  constexpr int kFewestCells = 6, kClear = 3;
  constexpr double kEnough = 0.8;
  CellMatch best;
  double best_score = -1, next_score = -1;
  int judged = 0;
  for (const bool mirrored : {false, true})
    for (int turns = 0; turns < 4; ++turns) {
      const int height = turns % 2 == 0 ? reading.rows : reading.columns, width = turns % 2 == 0 ? reading.columns : reading.rows;
      for (int row = 0; row + height <= Board::kRows; ++row)
        for (int column = 0; column + width <= Board::kColumns; ++column) {
          const Score s = score(reading, turns, mirrored, row, column);
          const double now = s.agree;
          if (now > best_score) {
            next_score = best_score;
            best_score = now;
            judged = s.judged;
            best = {mirrored ? CellMatch::Verdict::mirrored : CellMatch::Verdict::board, turns, row, column, s.judged > 0 ? now / s.judged : 0};
          } else {
            next_score = std::max(next_score, now);
          }
        }
    }
  if (judged < kFewestCells || best.agreement < kEnough || best_score - next_score < kClear) best.verdict = CellMatch::Verdict::foreign;
  return best;
}

}  // namespace booth::fit::calibrate
