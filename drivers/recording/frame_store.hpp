// One recorded camera's frames, whatever file they lie in: what the two layouts have in common.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::drivers {

enum class Load : std::uint8_t { ok, missing, broken };

/// Used by one thread at a time.
class FrameStore {
 public:
  virtual ~FrameStore() = default;
  /// Wall time of each frame, strictly increasing; its position is the frame's sequence number.
  virtual const std::vector<hal::UtcTime>& times() const = 0;
  /// Depth counts of frame i into `depth` (already of the right size). Never throws.
  virtual Load load(std::size_t i, std::vector<std::uint16_t>& depth) noexcept = 0;
};

/// What a layout's reader found.
struct RecordedCameraData {
  hal::CameraDescription description;
  std::unique_ptr<FrameStore> frames;
  std::vector<std::vector<std::uint16_t>> background;  ///< frames of the empty booth
};

/// Frames per second from the middle one of the intervals; 30 for fewer than two frames.
double rate_of(const std::vector<hal::UtcTime>& times);

}  // namespace booth::drivers
