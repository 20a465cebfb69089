// Gathers views of the board from all cameras, one after the other, and says what is still needed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/calibrate/board_detector.hpp"
#include "fit/calibrate/calibration.hpp"
#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// What one camera took of one view.
struct ViewPicture {
  int camera = 0;
  Grey16 infrared, depth;
};

/// What came of a view.
struct ViewReport {
  std::vector<int> seen;              ///< cameras that saw the board
  int mirrored = 0, foreign = 0;      ///< pictures with a board that is not ours
  fit::calibrate::Progress progress;  ///< of all views so far
};

/// The board in pictures of one moment.
struct FoundBoards {
  struct Board {
    fit::calibrate::Sighting sighting;  ///< its view is set when it is added
    fit::calibrate::BoardPose pose;
  };
  std::vector<Board> boards;
  int mirrored = 0, foreign = 0;
};

/// Not thread-safe. find() takes some tenths of a second a picture.
class ViewCollector {
 public:
  /// `cameras` as they are described now: their places are where they should stand; an `expected_known` of false says that nobody knows where.
  ViewCollector(std::vector<hal::CameraDescription> cameras, const fit::calibrate::Board& board, bool expected_known = true,
                const fit::calibrate::Needs& needs = {});

  /// Looks without taking the view, all pictures at once. Throws std::invalid_argument for a camera that does not exist or a picture of another size.
  FoundBoards find(const std::vector<ViewPicture>& pictures) const;
  /// Where the board lies on the floor, too slanted and too far away for find(): looked for by where views so far place cameras and floor. Nothing before they
  /// do. `found` is what find() found in these pictures; cameras that saw the board are not looked at again. Half a second.
  FoundBoards find_on_floor(const std::vector<ViewPicture>& pictures, FoundBoards found) const;
  /// Takes pictures of one moment, and what find() found in them, as a view.
  ViewReport add(const std::vector<ViewPicture>& pictures, FoundBoards found);
  ViewReport add(const std::vector<ViewPicture>& pictures) { return add(pictures, find(pictures)); }
  /// Adds what was found later to a view that was taken. Throws std::invalid_argument when there is no such view.
  void add_to_view(int view, FoundBoards found);
  /// How many cameras saw the board in a view.
  int seen_in(int view) const;
  bool saw(int view, int camera) const;

  /// "hold the board between front-left and back-left (2 of 4 views)"; empty when there is enough.
  std::string next_place() const;
  const fit::calibrate::CalibrationInput& input() const { return input_; }
  const std::vector<hal::CameraDescription>& cameras() const { return cameras_; }

 private:
  std::vector<std::pair<int, int>> neighbours() const;
  void update_progress();
  void take(const ViewPicture& picture, fit::calibrate::Sighting sighting, double most_rms, FoundBoards& out) const;
  void keep(int view, FoundBoards& found);
  /// Made anew when there are views that the last ones were not made from.
  const std::optional<std::vector<fit::calibrate::Rigid>>& places() const;

  std::vector<hal::CameraDescription> cameras_;
  fit::calibrate::CalibrationInput input_;
  std::vector<fit::calibrate::BoardPose> poses_;  // of the input's sightings
  fit::calibrate::Progress progress_;
  mutable std::optional<std::vector<fit::calibrate::Rigid>> places_;  // booth_from_camera, roughly
  mutable std::size_t placed_from_ = 0;                               // sightings
};

fit::calibrate::Rigid rigid_of(const hal::RigidTransform& t);
hal::RigidTransform transform_of(const fit::calibrate::Rigid& r);
fit::calibrate::Lens lens_of(const hal::Intrinsics& k);

}  // namespace booth::daemon
