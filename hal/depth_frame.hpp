// One depth image and the geometry of the camera that took it, as plain values.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/time.hpp"

namespace booth::hal {

/// Which of the booth's cameras; 0-based position in the configuration.
enum class CameraIndex : std::uint8_t {};
constexpr int to_int(CameraIndex c) { return static_cast<int>(c); }

/// Pinhole with Brown-Conrady distortion. Pixel (0, 0) is the *centre* of the first pixel.
struct Intrinsics {
  int width = 0, height = 0;              ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  std::array<double, 5> distortion{};     ///< k1 k2 p1 p2 k3
};

/// x_to = rotation * x_from + translation; rotation row-major, metres.
struct RigidTransform {
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> translation{};
};

/// What a camera is; constant between start() and stop(). Camera optical frame: z forward, x right, y down; never mirrored.
struct CameraDescription {
  std::string name;    ///< of the position in the booth, e.g. "front-left"
  std::string serial;  ///< of the device
  Intrinsics intrinsics;
  RigidTransform camera_to_world;  ///< into the booth frame (x forward, y left, z up)
  double depth_scale = 0.001;      ///< metres per count
  // What a calibration found of this camera's depth: at true depth z it reads (1 + gain) z + offset metres.
  double depth_gain = 0;
  double depth_offset = 0;     ///< metres
  double nominal_rate = 30.0;  ///< frames per second
};

/// A slot that the pipeline owns and a camera fills: `depth` is sized once, row-major, width * height counts along z; 0 = no measurement.
struct DepthFrame {
  CameraIndex camera{};
  std::uint64_t sequence = 0;  ///< of the device; gaps are lost frames
  MonotonicTime captured{};    ///< middle of the exposure
  MonotonicTime received{};    ///< when the host had all of it
  std::vector<std::uint16_t> depth;
  std::vector<std::uint16_t> infrared;  ///< brightness, pixel for pixel; filled where the slot's owner sized it and the camera has it
};

}  // namespace booth::hal
