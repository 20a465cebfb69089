// Simulated cameras before which somebody calibrates: he holds the board where it is wanted and moves on when he hears that a view was taken.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "drivers/synthetic/board_view.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::drivers {

/// Thread-safe.
class SimulatedInstaller {
 public:
  SimulatedInstaller(const fit::calibrate::Board& board, std::vector<fit::calibrate::Rigid> places) : board_(board), places_(std::move(places)) {}
  /// To the next place; after the last to the first again.
  void move_on() { ++at_; }
  std::optional<ShownBoard> shows() const;

 private:
  const fit::calibrate::Board board_;
  const std::vector<fit::calibrate::Rigid> places_;
  std::atomic<std::size_t> at_{0};
};

/// One camera for each description, which says where it really stands; `told` are what the cameras say of themselves (where they should stand). Frames come at
/// `rate` a second with infrared where the slot was sized for it. Throws std::invalid_argument when the two lists differ in length.
hal::DepthCameras make_board_cameras(const std::vector<hal::CameraDescription>& real, const std::vector<hal::CameraDescription>& told,
                                     const std::vector<BoardViewSettings>& settings, double rate, const std::shared_ptr<const SimulatedInstaller>& installer,
                                     const std::shared_ptr<hal::Clock>& clock);

}  // namespace booth::drivers
