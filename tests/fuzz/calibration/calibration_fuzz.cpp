// A calibration of any text, and one good table with any keys after it: cameras of finite numbers, or one sentence; what was read is written and read the same.
#include <cmath>
#include <stdexcept>
#include <string>

#include "drivers/recording/calibration_file.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth;
using fuzz::require;

const std::string& good() {
  static const std::string text = [] {
    hal::CameraDescription camera;
    camera.name = "a";
    camera.intrinsics = {.width = 8, .height = 8, .fx = 8, .fy = 8, .cx = 4, .cy = 4, .distortion = {}};
    return drivers::calibration_text({camera});
  }();
  return text;
}

void read(const std::string& text) {
  std::vector<hal::CameraDescription> cameras;
  try {
    cameras = drivers::parse_calibration_text(text, "x");
  } catch (const std::runtime_error&) {
    return;
  }
  for (const auto& c : cameras) {
    require(c.intrinsics.width > 0 && c.intrinsics.height > 0, "a camera has a size");
    for (const double v : {c.intrinsics.fx, c.intrinsics.fy, c.intrinsics.cx, c.intrinsics.cy, c.depth_scale})
      require(std::isfinite(v), "intrinsics are finite");
    for (const double v : c.intrinsics.distortion) require(std::isfinite(v), "distortion is finite");
    for (const double v : c.camera_to_world.translation) require(std::isfinite(v), "places are finite");
    double square = 0;
    for (const double v : c.camera_to_world.rotation) square += v * v;
    require(std::abs(square - 3) < 1e-6, "a rotation is one");
  }
  const std::string once = drivers::calibration_text(cameras);
  require(drivers::calibration_text(drivers::parse_calibration_text(once, "y")) == once, "what was written reads back the same");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  read(text);
  read(good() + text);
  return 0;
}
