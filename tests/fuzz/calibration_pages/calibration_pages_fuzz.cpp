// Calibration pages of any length and content: each parser throws with a sentence or returns numbers within the stated ranges.
#include <cctype>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers::kinect2;
using booth::fuzz::Input;
using booth::fuzz::require;

/// The first bytes from the input, the rest from a seed or zeros; cut or lengthened by some bytes. A page of megabytes costs an input three bytes.
std::vector<std::byte> page(Input& input, std::size_t natural) {
  const unsigned how = input.u8();
  std::vector<std::byte> out(natural + (how & 1 ? input.u8() : 0u));
  if (how & 2) booth::fuzz::fill(out, input.u8());
  if (how & 4) out.resize(out.size() - std::min<std::size_t>(out.size(), input.u16()));
  std::size_t at = how & 8 ? input.u16() : 0;
  for (const std::byte b : input.bytes(4096))
    if (at < out.size()) out[at++] = b;
  return out;
}

bool within(double v, double low, double high) { return v >= low && v <= high; }  // false for what is no number

void parse(Input& input) {
  switch (input.u8() % 6) {
    case 0: {
      const auto p = parse_depth_camera(page(input, kDepthCameraBytes));
      require(within(p.fx, 300, 450) && within(p.fy, 300, 450) && within(p.cx, 200, 320) && within(p.cy, 150, 280), "focal lengths and centre are in range");
      require(within(p.k1, -1, 1) && within(p.k2, -1, 1) && within(p.k3, -1, 1) && within(p.p1, -0.1, 0.1) && within(p.p2, -0.1, 0.1),
              "distortion is in range");
      const auto k = unmirrored_intrinsics(p);
      require(k.width == kWidth && within(k.cx, 190, 312), "the mirrored centre is in the picture");
      break;
    }
    case 1:
      for (const auto& table : parse_phase_offsets(page(input, kPhaseTablesBytes)).p0) require(table.size() == kPixels, "a phase table has every pixel");
      break;
    case 2: {
      const auto p = parse_colour_camera(page(input, kColourCameraBytes));
      require(within(p.fc, 100, 10'000) && p.d0 > 0, "focal length and nominal depth are in range");
      for (std::size_t i = 0; i < 10; ++i) require(std::isfinite(p.x[i]) && std::isfinite(p.y[i]), "polynomials are finite");
      break;
    }
    case 3: {
      const auto serial = parse_serial(page(input, 128));
      require(!serial.empty() && serial.size() <= 64, "a serial has 1 to 64 characters");
      for (const char c : serial) require(std::isalnum(static_cast<unsigned char>(c)) != 0, "a serial has letters and digits only");
      break;
    }
    case 4:
      require(parse_firmware(page(input, 512)).size() < 64, "a firmware's name is short");
      break;
    default:
      (void)parse_serial(input.bytes(4096));  // as it is, odd lengths included
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  try {
    parse(input);
  } catch (const std::runtime_error& e) {
    require(e.what()[0] != '\0', "an error says what is wrong");
  }
  return 0;
}
