// Parsing the calibration pages: everything a device says is checked before a table is built from it.
#include "drivers/kinect2/calibration.hpp"

#include <algorithm>
#include <array>
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

void ranged(const char* page, double value, double low, double high, const std::string& name) {
  if (value >= low && value <= high) return;
  throw std::runtime_error(std::string(page) + ": " + name + " is " + std::to_string(value) + ", expected from " + std::to_string(low) + " to " +
                           std::to_string(high));
}

}  // namespace

void check(const DepthCameraParameters& p) {
  constexpr const char* kPage = "depth camera parameters";
  ranged(kPage, p.fx, 300, 450, "fx");
  ranged(kPage, p.fy, 300, 450, "fy");
  ranged(kPage, p.cx, 200, 320, "cx");
  ranged(kPage, p.cy, 150, 280, "cy");
  // Known lenses have |k| below 0.3; beyond these limits the model folds over inside the picture.
  ranged(kPage, p.k1, -1, 1, "k1");
  ranged(kPage, p.k2, -1, 1, "k2");
  ranged(kPage, p.p1, -0.1, 0.1, "p1");
  ranged(kPage, p.p2, -0.1, 0.1, "p2");
  ranged(kPage, p.k3, -1, 1, "k3");
}

void check(const ColourCameraParameters& p) {
  constexpr const char* kPage = "colour camera parameters";
  ranged(kPage, p.fc, 100, 10'000, "the focal length");
  ranged(kPage, p.ccx, -10'000, 10'000, "ccx");
  ranged(kPage, p.ccy, -10'000, 10'000, "ccy");
  ranged(kPage, p.d0, 1, 100'000, "the nominal depth");
  ranged(kPage, p.b, -1000, 1000, "the displacement");
  for (std::size_t i = 0; i < 10; ++i) {
    ranged(kPage, p.x[i], -1e6, 1e6, "coefficient x" + std::to_string(i));
    ranged(kPage, p.y[i], -1e6, 1e6, "coefficient y" + std::to_string(i));
  }
}

DepthCameraParameters parse_depth_camera(std::span<const std::byte> reply) {
  need(reply, kDepthCameraBytes, "depth camera parameters");
  const auto at = [&](std::size_t i) { return static_cast<double>(read_f32(reply, 4 * i)); };
  // Words that nobody uses are checked too: where they are no numbers, the others are not to be trusted.
  for (std::size_t i = 0; i < kDepthCameraBytes / 4; ++i)
    if (!std::isfinite(at(i))) throw std::runtime_error("depth camera parameters: number " + std::to_string(i) + " is not finite");
  DepthCameraParameters p{.fx = at(0), .fy = at(1), .cx = at(3), .cy = at(4), .k1 = at(5), .k2 = at(6), .p1 = at(7), .p2 = at(8), .k3 = at(9)};
  check(p);
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

std::string unusual_phase_header(std::span<const std::byte> reply) {
  // Header size, frequencies, bytes of a frequency, of a table and of a multiplier; the sizes of what follows the tables are anybody's guess.
  constexpr std::array<std::uint32_t, 5> kUsual{32, 3, 2, 2 * kPixels, 2};
  std::string words;
  bool usual = reply.size() >= kPhaseHeaderBytes;
  for (std::size_t i = 0; i < kPhaseHeaderBytes / 4 && 4 * i + 4 <= reply.size(); ++i) {
    const std::uint32_t word = read_u32(reply, 4 * i);
    words += (i == 0 ? "" : " ") + std::to_string(word);
    usual = usual && (i >= kUsual.size() || word == kUsual[i]);
  }
  return usual ? "" : "the phase offset tables have an unusual header (" + words + ")";
}

ColourCameraParameters parse_colour_camera(std::span<const std::byte> reply) {
  need(reply, kColourCameraBytes, "colour camera parameters");
  const auto at = [&](std::size_t i) { return static_cast<double>(read_f32(reply, 1 + 4 * i)); };
  ColourCameraParameters p{.fc = at(0), .ccx = at(1), .ccy = at(2), .d0 = at(3), .b = at(4), .x = {}, .y = {}};
  for (std::size_t i = 0; i < 10; ++i) {
    p.x[i] = at(5 + i);
    p.y[i] = at(15 + i);
  }
  check(p);
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

std::string parse_board(std::span<const std::byte> reply) {
  constexpr std::size_t kBoard = 0x48;
  std::string board;
  for (std::size_t at = kBoard; at < std::min(reply.size(), kHardwareBytes); ++at) {
    const auto c = std::to_integer<unsigned char>(reply[at]);
    if (c <= ' ' || c > '~') break;
    board += static_cast<char>(c);
  }
  return board;
}

hal::Intrinsics unmirrored_intrinsics(const DepthCameraParameters& p) {
  // Device pixel c has its centre at c + 0.5, ours at c; mirroring turns x into -x, and with it the sign of p2's effect.
  return {
      .width = kWidth, .height = kHeight, .fx = p.fx, .fy = p.fy, .cx = kWidth - 0.5 - p.cx, .cy = p.cy - 0.5, .distortion = {p.k1, p.k2, p.p1, -p.p2, p.k3}};
}

DepthCameraParameters mirrored_parameters(const hal::Intrinsics& k) {
  const auto& d = k.distortion;
  return {.fx = k.fx, .fy = k.fy, .cx = kWidth - 0.5 - k.cx, .cy = k.cy + 0.5, .k1 = d[0], .k2 = d[1], .p1 = d[2], .p2 = -d[3], .k3 = d[4]};
}

}  // namespace booth::drivers::kinect2
