// A calibration file that somebody else wrote: it is refused, or it holds what a sensor could have sent.
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/calibration_cache.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers::kinect2;
using booth::fuzz::Input;
using booth::fuzz::require;

/// A folder of this process, in memory where that is possible; removed at the end.
struct Folder {
  Folder() {
    const std::filesystem::path memory = "/dev/shm";
    path = (::access(memory.c_str(), W_OK) == 0 ? memory : std::filesystem::temp_directory_path()) / ("boothd-fuzz-" + std::to_string(::getpid()));
    std::filesystem::create_directories(path);
  }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path, error);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::filesystem::path path;
};

Calibration good() {
  Calibration c;
  c.serial = "012345";
  c.firmware = "4.0.3916.0";
  c.depth = {.fx = 365, .fy = 365, .cx = 260, .cy = 205, .k1 = 0.09, .k2 = -0.27, .p1 = 0, .p2 = 0, .k3 = 0.1};
  c.colour.fc = 1081;
  c.colour.d0 = 863;
  for (std::size_t f = 0; f < 3; ++f) c.phase.p0[f].assign(kPixels, static_cast<std::uint16_t>(1000 * f));
  return c;
}

std::vector<std::byte> read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(in), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// FNV-1a over all but the last eight bytes, as the cache itself puts it there: what lies behind the checksum must be tried too.
void sign(std::vector<std::byte>& bytes) {
  std::uint64_t hash = 0xcbf2'9ce4'8422'2325;
  const std::size_t body = bytes.size() - 8;
  for (std::size_t i = 0; i < body; ++i) hash = (hash ^ std::to_integer<std::uint64_t>(bytes[i])) * 0x100'0000'01b3;
  for (std::size_t i = 0; i < 8; ++i) bytes[body + i] = static_cast<std::byte>(hash >> (8 * i) & 0xFF);
}

bool within(double v, double low, double high) { return v >= low && v <= high; }

void inspect(const Calibration& c) {
  require(c.serial == "012345" && c.firmware == "4.0.3916.0", "a calibration belongs to the sensor that was asked for");
  require(within(c.depth.fx, 300, 450) && within(c.depth.fy, 300, 450) && within(c.depth.cx, 200, 320) && within(c.depth.cy, 150, 280),
          "focal lengths and centre are in range");
  for (const double k : {c.depth.k1, c.depth.k2, c.depth.k3, c.depth.p1, c.depth.p2}) require(within(k, -1, 1), "distortion is in range");
  for (const double k : c.colour.x) require(std::isfinite(k), "polynomials are finite");
  require(within(c.colour.fc, 100, 10'000) && c.colour.d0 > 0, "colour focal length and nominal depth are in range");
  for (const auto& table : c.phase.p0) require(table.size() == kPixels, "a phase table has every pixel");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Folder folder;
  static const CalibrationCache cache(folder.path);
  static const auto original = [] {
    require(cache.store(good()), "a calibration can be stored");
    return read_file(folder.path / "012345-4.0.3916.0.calibration");
  }();
  Input input(data, size);
  const unsigned how = input.u8();
  auto bytes = original;
  while (!input.empty()) {  // patches: where, how many, which; the first two kilobytes hold everything but the tables
    std::size_t at = how & 1 ? input.u32() % bytes.size() : input.u16() % 2048u;
    for (const std::byte b : input.bytes(input.u8() % 64))
      if (at < bytes.size()) bytes[at++] = b;
  }
  if (how & 2) sign(bytes);
  if (how & 4) bytes.resize(bytes.size() / (1 + how / 16));
  if (how & 8) bytes.push_back(std::byte{1});
  {
    std::ofstream out(folder.path / "012345-4.0.3916.0.calibration", std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  if (const auto c = cache.load("012345", "4.0.3916.0")) inspect(*c);
  if (how & 32)  // reads it once more: rarely, for speed
    if (const auto c = cache.load_latest("012345")) require(c->serial == "012345", "the latest is the sensor's own");
  require(!cache.load("../012345", "4.0.3916.0"), "a serial is no path");
  return 0;
}
