// What a Kinect v2 knows about itself: lens, phase offsets, colour camera; parsed from its replies, checked before anyone uses it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::drivers::kinect2 {

/// Of the image as the device sends it: mirrored, row 0 on top; pixel (c, r) has its centre at (c + 0.5, r + 0.5).
struct DepthCameraParameters {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
};

struct ColourCameraParameters {
  double fc = 0, ccx = 0, ccy = 0;  ///< pixels
  double d0 = 0, b = 0;             ///< millimetres
  std::array<double, 10> x{}, y{};  ///< of x^3, y^3, x^2 y, x y^2, x^2, y^2, x y, x, y, 1
};

/// Per frequency (80, 16, 120 MHz) a row-major 424 x 512 table, full scale = one turn; row 0 on top, device (mirrored) columns.
struct PhaseOffsets {
  std::array<std::vector<std::uint16_t>, 3> p0;
};

struct Calibration {
  std::string serial;    ///< [0-9A-Za-z], as read by command
  std::string firmware;  ///< "major.minor.build.qfe" of the main application
  DepthCameraParameters depth;
  PhaseOffsets phase;
  ColourCameraParameters colour;
};

/// Throws std::runtime_error naming the first number that cannot belong to such a sensor: tables made from it would be nonsense.
void check(const DepthCameraParameters& parameters);
void check(const ColourCameraParameters& parameters);

// Each throws std::runtime_error with what is wrong; nothing is taken from a reply that is too short, not finite or out of range.
DepthCameraParameters parse_depth_camera(std::span<const std::byte> reply);
PhaseOffsets parse_phase_offsets(std::span<const std::byte> reply);
ColourCameraParameters parse_colour_camera(std::span<const std::byte> reply);
/// What is unusual about the header of the phase offset tables, for the log; empty for the header that all known sensors have. Nothing depends on it.
std::string unusual_phase_header(std::span<const std::byte> reply);
/// Letters and digits up to a zero code unit or the end of the reply.
std::string parse_serial(std::span<const std::byte> reply);
std::string parse_firmware(std::span<const std::byte> reply);
/// The board's code, e.g. "GMF631.1X", of the hardware information; empty where there is none. Only for the log.
std::string parse_board(std::span<const std::byte> reply);

/// For the HAL's image, which is not mirrored: column 511 - c of the device's, pixel (0, 0) is the centre of the first pixel.
hal::Intrinsics unmirrored_intrinsics(const DepthCameraParameters& parameters);
/// The inverse, for an emulated sensor that is to see what such a camera sees.
DepthCameraParameters mirrored_parameters(const hal::Intrinsics& intrinsics);

}  // namespace booth::drivers::kinect2
