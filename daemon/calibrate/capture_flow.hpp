// When a view is worth taking, and what to tell the person who holds the board: a pure function of what the cameras see.
#pragma once

#include <optional>
#include <vector>

#include "daemon/calibrate/capture_cue.hpp"
#include "fit/calibrate/rigid.hpp"

namespace booth::daemon {

/// What one look of all cameras found.
struct BoardLook {
  struct Seen {
    int camera;
    fit::calibrate::Rigid camera_from_board;
  };
  double seconds = 0;        ///< any steady clock
  std::vector<Seen> seen;    ///< cameras that saw the board
  bool wrong_board = false;  ///< mirrored or foreign
};

struct CaptureRules {
  double still_seconds = 0.8;  ///< how long the board must not move; 0: views are taken at first sight
  // One picture tells the direction of a board to a tenth of a pixel, but its distance to centimetres and its tilt to degrees when it is seen at a slant.
  double still_direction = 0.003;  ///< radians between lines of sight to its middle
  double still_metres = 0.1;       ///< along them
  double still_radians = 0.2;
  double new_metres = 0.12, new_radians = 0.2;  ///< from every view taken by the same camera: nearer than both is the same view
};

/// Remembers views and the last looks; looks come in order of time. One thread at a time.
class CaptureFlow {
 public:
  explicit CaptureFlow(const CaptureRules& rules = {}) : rules_(rules) {}

  /// `captured` means: take this look's pictures as a view. After finish() every look is answered `done`.
  CaptureCue look(const BoardLook& look);
  void finish() { finished_ = true; }
  int taken() const { return taken_; }

 private:
  bool moved(const BoardLook& look) const;
  bool is_new(const BoardLook& look) const;

  CaptureRules rules_;
  std::optional<BoardLook> anchor_;  // where the board came to rest
  std::vector<BoardLook::Seen> views_;
  int taken_ = 0;
  bool finished_ = false;
};

}  // namespace booth::daemon
