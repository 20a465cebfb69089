// Written by hand: rectangles, circles of four Bezier curves, and one of the fonts that every reader has.
#include "daemon/calibrate/board_pdf.hpp"

#include <fmt/format.h>

#include <cctype>
#include <vector>

namespace booth::daemon {
namespace {

using fit::calibrate::Board;
constexpr double kPoint = 72 / 25.4;  // points a millimetre

/// Page contents in millimetres, origin at the lower left.
class Page {
 public:
  void grey(double g) { out_ += fmt::format("{:.2f} g\n", g); }
  void rectangle(double x, double y, double w, double h) {
    out_ += fmt::format("{:.4f} {:.4f} {:.4f} {:.4f} re f\n", x * kPoint, y * kPoint, w * kPoint, h * kPoint);
  }
  void disc(double x, double y, double r) {
    constexpr double k = 0.5522847498;  // of the radius: a quarter circle to 0.03 %
    move(x + r, y, "m");
    curve(x + r, y + k * r, x + k * r, y + r, x, y + r);
    curve(x - k * r, y + r, x - r, y + k * r, x - r, y);
    curve(x - r, y - k * r, x - k * r, y - r, x, y - r);
    curve(x + k * r, y - r, x + r, y - k * r, x + r, y);
    out_ += "f\n";
  }
  void triangle(double x0, double y0, double x1, double y1, double x2, double y2) {
    move(x0, y0, "m"), move(x1, y1, "l"), move(x2, y2, "l");
    out_ += "f\n";
  }
  /// Plain ASCII without brackets or backslashes.
  void text(double x, double y, double height, const std::string& line) {
    out_ += fmt::format("BT /F1 {:.2f} Tf {:.4f} {:.4f} Td ({}) Tj ET\n", height * kPoint, x * kPoint, y * kPoint, line);
  }
  const std::string& contents() const { return out_; }

 private:
  void move(double x, double y, const char* how) { out_ += fmt::format("{:.4f} {:.4f} {}\n", x * kPoint, y * kPoint, how); }
  void curve(double ax, double ay, double bx, double by, double x, double y) {
    out_ += fmt::format("{:.4f} {:.4f} {:.4f} {:.4f} {:.4f} {:.4f} c\n", ax * kPoint, ay * kPoint, bx * kPoint, by * kPoint, x * kPoint, y * kPoint);
  }
  std::string out_;
};

void draw_board(Page& page, const fit::calibrate::Paper& paper) {
  const double s = paper.square, left = (paper.width - Board::kColumns * s) / 2, top = paper.height - (paper.height - Board::kRows * s) / 2;
  for (int r = 0; r < Board::kRows; ++r)
    for (int c = 0; c < Board::kColumns; ++c) {
      const double x = left + c * s, y = top - (r + 1) * s;
      const bool black = Board::black(r, c);
      if (black) page.grey(0), page.rectangle(x, y, s, s);
      if (!Board::dotted(r, c)) continue;
      page.grey(black ? 1 : 0);
      page.disc(x + s / 2, y + s / 2, Board::kDotRadius * s);
    }
}

void draw_margins(Page& page, const fit::calibrate::Paper& paper) {
  const double margin = (paper.height - Board::kRows * paper.square) / 2, side = (paper.width - Board::kColumns * paper.square) / 2, middle = paper.height / 2;
  page.grey(0);
  // The arrow along x, to the booth's front when the board lies on the floor.
  page.triangle(paper.width - 0.75 * side, middle - 0.25 * side, paper.width - 0.75 * side, middle + 0.25 * side, paper.width - 0.3 * side, middle);
  const double left = (paper.width - Board::kColumns * paper.square) / 2, base = 0.45 * margin;
  // A ruler of ten centimetres.
  constexpr double kLine = 0.2;
  page.rectangle(left, base, 100, kLine);
  for (int mm = 0; mm <= 100; mm += 5) page.rectangle(left + mm - kLine / 2, base, kLine, mm % 10 == 0 ? 3 : 1.8);
  std::string name = paper.name;
  for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  page.text(left + 103, base, 2.6, fmt::format("100 mm. Squares {:.0f} mm, board {} of boothd. Print at 100 %, matt, with toner.", paper.square, name));
}

}  // namespace

std::string board_pdf(const fit::calibrate::Paper& paper) {
  Page page;
  draw_board(page, paper);
  draw_margins(page, paper);
  const std::vector<std::string> objects{
      "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
      "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.4f} {:.4f}] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>", paper.width * kPoint,
                  paper.height * kPoint),
      fmt::format("<< /Length {} >>\nstream\n{}endstream", page.contents().size(), page.contents()),
      "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
  };
  std::string out = "%PDF-1.4\n";
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    at.push_back(out.size());
    out += fmt::format("{} 0 obj\n{}\nendobj\n", i + 1, objects[i]);
  }
  const std::size_t table = out.size();
  out += fmt::format("xref\n0 {}\n0000000000 65535 f \n", objects.size() + 1);
  for (const std::size_t offset : at) out += fmt::format("{:010d} 00000 n \n", offset);
  out += fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", objects.size() + 1, table);
  return out;
}

}  // namespace booth::daemon
