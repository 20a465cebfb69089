// Parsing the calibration pages: everything a device says is checked before a table is built from it.
#include "drivers/kinect2/calibration.hpp"

#include <cmath>
#include <stdexcept>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

constexpr std::size_t kPhaseHeaderBytes = 32;
constexpr std::size_t kPhaseBlockBytes = 2 + 2 * kPixels + 2;  // frequency, table, amplitude multiplier

void need(std::span<const std::byte> reply, std::size_t bytes, const char* what) {
  if (reply.size() < bytes)
    throw std::runtime_error(std::string(what) + ": the device sent " + std::to_string(reply.size()) + " bytes, " + std::to_string(bytes) + " are needed");
}

double ranged(double value, double low, double high, const char* name) {
  if (!(value >= low && value <= high))
    throw std::runtime_error(std::string("depth camera parameters: ") + name + " is " + std::to_string(value) + ", expected from " + std::to_string(low) +
                             " to " + std::to_string(high));
  return value;
}

}  // namespace

DepthCameraParameters parse_depth_camera(std::span<const std::byte> reply) {
  need(reply, kDepthCameraBytes, "depth camera parameters");
  const auto at = [&](std::size_t i) { return static_cast<double>(read_f32(reply, 4 * i)); };
  DepthCameraParameters p;
  p.fx = ranged(at(0), 300, 450, "fx");
  p.fy = ranged(at(1), 300, 450, "fy");
  p.cx = ranged(at(3), 200, 320, "cx");
  p.cy = ranged(at(4), 150, 280, "cy");
  // Known lenses have |k| below 0.3; beyond these limits the model folds over inside the picture.
  p.k1 = ranged(at(5), -1, 1, "k1");
  p.k2 = ranged(at(6), -1, 1, "k2");
  p.p1 = ranged(at(7), -0.1, 0.1, "p1");
  p.p2 = ranged(at(8), -0.1, 0.1, "p2");
  p.k3 = ranged(at(9), -1, 1, "k3");
  return p;
}

PhaseOffsets parse_phase_offsets(std::span<const std::byte> reply) {
  need(reply, kPhaseTablesBytes, "phase offset tables");
  PhaseOffsets out;
  for (std::size_t f = 0; f < 3; ++f) {
    auto& table = out.p0[f];
    table.resize(kPixels);
    const std::size_t start = kPhaseHeaderBytes + f * kPhaseBlockBytes + 2;
    for (std::size_t i = 0; i < kPixels; ++i) table[i] = read_u16(reply, start + 2 * i);
  }
  return out;
}

ColourCameraParameters parse_colour_camera(std::span<const std::byte> reply) {
  need(reply, kColourCameraBytes, "colour camera parameters");
  const auto at = [&](std::size_t i) {
    const auto value = static_cast<double>(read_f32(reply, 1 + 4 * i));
    if (!std::isfinite(value)) throw std::runtime_error("colour camera parameters: number " + std::to_string(i) + " is not finite");
    return value;
  };
  ColourCameraParameters p;
  p.fc = at(0);
  p.ccx = at(1);
  p.ccy = at(2);
  p.d0 = at(3);
  p.b = at(4);
  if (!(p.fc > 100 && p.fc < 10'000) || !(p.d0 > 0)) throw std::runtime_error("colour camera parameters: focal length or nominal depth is out of range");
  for (std::size_t i = 0; i < 10; ++i) {
    p.x[i] = at(5 + i);
    p.y[i] = at(15 + i);
  }
  return p;
}

std::string parse_serial(std::span<const std::byte> reply) {
  std::string serial;
  for (std::size_t i = 0; i + 1 < reply.size(); i += 2) {
    const std::uint16_t unit = read_u16(reply, i);
    if (unit == 0) break;
    const bool letter = (unit >= 'A' && unit <= 'Z') || (unit >= 'a' && unit <= 'z'), digit = unit >= '0' && unit <= '9';
    if (!letter && !digit) throw std::runtime_error("serial: the device sent a character that is no letter or digit");
    serial += static_cast<char>(unit);
  }
  if (serial.empty() || serial.size() > 64)
    throw std::runtime_error("serial: the device sent " + std::to_string(serial.size()) + " characters, expected 1 to 64");
  return serial;
}

std::string parse_firmware(std::span<const std::byte> reply) {
  constexpr std::size_t kMainApplication = 3 * 16;  // the fourth of the 16-byte records
  need(reply, kMainApplication + 16, "firmware versions");
  const std::uint32_t version = read_u32(reply, kMainApplication);
  return std::to_string(version >> 16) + "." + std::to_string(version & 0xFFFF) + "." + std::to_string(read_u32(reply, kMainApplication + 4)) + "." +
         std::to_string(read_u32(reply, kMainApplication + 8));
}

hal::Intrinsics unmirrored_intrinsics(const DepthCameraParameters& p) {
  // Device pixel c has its centre at c + 0.5, ours at c; mirroring turns x into -x, and with it the sign of p2's effect.
  return {
      .width = kWidth, .height = kHeight, .fx = p.fx, .fy = p.fy, .cx = kWidth - 0.5 - p.cx, .cy = p.cy - 0.5, .distortion = {p.k1, p.k2, p.p1, -p.p2, p.k3}};
}

}  // namespace booth::drivers::kinect2
