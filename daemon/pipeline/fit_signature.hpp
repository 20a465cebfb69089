// One number for everything that the fit computes: whoever changes the mathematics sees it change.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/pipeline/frame_record.hpp"
#include "fit/estimator.hpp"

namespace booth::daemon {

/// FNV-1a over the bits of q, beta and the state of each frame, in order.
class FitSignature {
 public:
  void add(const FrameRecord& frame);
  /// 16 hexadecimal digits.
  std::string text() const;
  std::uint64_t frames() const { return frames_; }

 private:
  void add_bytes(const void* data, std::size_t size);
  std::uint64_t hash_ = 0xcbf29ce484222325u;
  std::uint64_t frames_ = 0;
};

/// The golden frames: the simulated booth (test:1, showcase, Kinect v2 noise, seed 1), rendered on the fly from the committed models, fitted
/// with `threads` threads. Throws as make_fit_setup().
std::string golden_signature(int threads, int frames);

/// The same frames with preset paper computed by a device (an emulated one where `open_device` makes it): every device has the same signature, since the
/// kernels neither fuse nor reorder operations. Throws std::runtime_error that says why where the device is not there, or was lost on the way.
std::string golden_device_signature(int threads, int frames, const fit::DeviceOpen& open_device = {});

inline constexpr int kGoldenFrames = 30;

}  // namespace booth::daemon
