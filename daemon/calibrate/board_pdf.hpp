// The calibration board as a page to print.
#pragma once

#include <string>

#include "fit/calibrate/board.hpp"

namespace booth::daemon {

/// A PDF 1.4 of one page at true scale: the board in vectors, an arrow to the front, a ruler of 100 mm and what to mind when printing. The same paper gives the
/// same bytes.
std::string board_pdf(const fit::calibrate::Paper& paper);

}  // namespace booth::daemon
