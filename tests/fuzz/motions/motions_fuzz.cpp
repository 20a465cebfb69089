// AMC, BVH and .npy motions of any bytes: at least one frame of finite numbers, or one sentence.
#include <cmath>
#include <stdexcept>
#include <string>

#include "daemon/io/motion_file.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const booth::fuzz::Scratch scratch;
  booth::fuzz::Input in(data, size);
  const char* name = std::array{"a.amc", "a.bvh", "a.npy"}[in.u8() % 3];
  const auto rest = in.bytes(size);
  const auto file = scratch.put(name, {reinterpret_cast<const char*>(rest.data()), rest.size()});
  try {
    const auto frames = booth::daemon::read_motion(file);
    booth::fuzz::require(!frames.empty(), "a motion has a frame");
    for (const auto& q : frames) booth::fuzz::require(q.allFinite(), "poses are finite");
  } catch (const std::runtime_error& e) {
    booth::fuzz::require(std::string(e.what()).find(name) != std::string::npos, "the sentence names the file");
  }
  return 0;
}
