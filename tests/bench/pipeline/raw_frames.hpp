// Turns rendered depth into what the sensors would have sent, and back in the camera's thread: the depth decode as part of the pipeline.
#pragma once

#include <memory>
#include <vector>

#include "tests/support/memory_camera.hpp"

namespace booth::bench {

/// Ten packed phase images for each frame of a memory of Kinect-sized cameras (3 MB a frame). Const calls may run side by side.
class RawFrames {
 public:
  explicit RawFrames(const tests::FrameMemory& memory);
  /// A decoder of its own for one camera, with the fastest kernel there is; `on_device`: on the CUDA device. Throws std::runtime_error where there is none.
  tests::MemoryCamera::Decode decoder(std::size_t camera, bool on_device = false) const;
  std::size_t bytes() const;

 private:
  std::shared_ptr<std::vector<std::vector<std::vector<std::byte>>>> images_;  ///< [camera][number]
};

}  // namespace booth::bench
