// The counterpart of DepthCamera: where frames and the truth beside them can be recorded.
#pragma once

#include <span>

#include "hal/depth_frame.hpp"
#include "hal/ground_truth.hpp"

namespace booth::hal {

/// One recording being written. Not thread-safe. What was closed is complete; what was not is a leftover with a temporary name.
class DepthSink {
 public:
  virtual ~DepthSink() = default;
  /// Appends a frame of one of the cameras given at construction. `utc` is the wall time of frame.captured. Throws std::runtime_error (disk full, ...).
  virtual void write(const DepthFrame& frame, UtcTime utc) = 0;
  /// The truth at an instant, where it is known (truth.csv).
  virtual void write_truth(UtcTime utc, const TruthSample& truth) = 0;
  /// Flushes to stable storage and gives the recording its final name.
  virtual void close() = 0;
};

}  // namespace booth::hal
