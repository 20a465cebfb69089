// What a simulated camera sees of a room in which somebody holds the calibration board: infrared and depth, with the faults of real pictures.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/synthetic/noise.hpp"
#include "fit/calibrate/board.hpp"
#include "fit/calibrate/rigid.hpp"
#include "hal/depth_frame.hpp"

namespace booth::drivers {

/// The sheet that is shown and how.
struct ShownBoard {
  enum class Print : std::uint8_t { board, mirrored, plain, other };  ///< plain: without dots; other: a chessboard of 9 x 6 squares
  Print print = Print::board;
  fit::calibrate::Board board;
  fit::calibrate::Rigid booth_from_board;
  double hidden = 0;  ///< part of the long side, from the right end, that an arm covers
  double glare = 0;   ///< strength of the lamp's mirror image on a glossy sheet: 0 matt, 1 a laminated one
};

struct BoardViewSettings {
  NoiseModel noise{};
  std::uint64_t seed = 1;
  double blur = 0.5;                        ///< pixels, standard deviation, of the lens
  double room_half_width = 3.0;             ///< walls at x, y = +-this
  double depth_gain = 0, depth_offset = 0;  ///< what this camera reads at true depth z: (1 + gain) z + offset metres
};

/// One camera in one room. Allocates; not for the frame path. One thread at a time.
class BoardCamera {
 public:
  /// `camera.camera_to_world` is where it really stands.
  BoardCamera(const hal::CameraDescription& camera, int camera_index, const BoardViewSettings& settings);

  /// Brightness as of a Kinect v2 (20000 for white paper at a metre), counts of the camera's depth scale, pixel for pixel. The same number gives the same bits.
  hal::DepthFrame look(const std::optional<ShownBoard>& shown, std::uint64_t frame);

 private:
  struct Surface {
    float z = 0, brightness = 0, sigma = 0;  // metres along z; before noise; metres
  };
  Surface room_at(double u, double v) const;
  void paint(const ShownBoard& shown);

  const hal::CameraDescription camera_;
  const int index_;
  const BoardViewSettings settings_;
  fit::calibrate::Rigid camera_from_booth_;
  std::vector<Surface> room_, picture_;
};

}  // namespace booth::drivers
