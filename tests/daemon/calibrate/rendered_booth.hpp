// Views of the board rendered once for all tests of a program: infrared and depth with distortion, noise and blur, and the truth.
#pragma once

#include <functional>
#include <vector>

#include "daemon/calibrate/view_collector.hpp"
#include "drivers/synthetic/board_view.hpp"

namespace booth::tests {

/// Four cameras, a walk around the booth with the board, everything detected. `change`, where given, alters what is shown in a view.
struct RenderedBooth {
  std::vector<hal::CameraDescription> planned, real;
  std::vector<drivers::BoardCamera> camera;
  std::vector<double> depth_offset;
  std::vector<fit::calibrate::Rigid> places;

  RenderedBooth(double side, std::uint64_t seed, int views);
  std::vector<hal::DepthFrame> look(int view, const std::function<void(drivers::ShownBoard&)>& change = {});
};

std::vector<daemon::ViewPicture> pictures_of(const std::vector<hal::DepthFrame>& frames);

}  // namespace booth::tests
