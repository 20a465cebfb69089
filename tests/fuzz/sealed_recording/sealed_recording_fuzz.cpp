// The opened stream of a sealed recording, of any content: a bag is made of it, or one sentence. Only a key's holder can make such a stream, but a booth that
// was taken over could.
#include <stdlib.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/sealed_recording.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

namespace fs = std::filesystem;
using namespace booth;

std::string record(std::uint8_t kind, const std::string& contents) {
  std::string out;
  for (int i = 0; i < 4; ++i) out += static_cast<char>(contents.size() >> (8 * i) & 0xff);
  return out + static_cast<char>(kind) + contents;
}

const std::string& header() {
  static const std::string text = [] {
    hal::CameraDescription camera;
    camera.name = "c";
    camera.intrinsics = {.width = 8, .height = 8, .fx = 8, .fy = 8, .cx = 4, .cy = 4, .distortion = {}};
    return record(1, std::string("\x01\x05") + drivers::calibration_text({camera}));
  }();
  return text;
}

/// Records of the kinds and contents that the input names.
std::string records(fuzz::Input& in) {
  std::string out;
  while (!in.empty()) {
    const std::uint8_t kind = in.u8() % 7;
    const auto bytes = in.bytes(in.u8());
    std::string contents(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (kind == 4) contents.resize(8 + 8 + 8 + 1 + 8 * hal::kMostRecordedCameras + 8 * hal::kRecordedDofs, '\x01');
    out += record(kind, contents);
  }
  return out;
}

void unpack(const std::string& stream, const fs::path& out) {
  std::size_t at = 0;
  const auto next = [&](std::string& piece) {
    if (at >= stream.size()) return false;
    piece = stream.substr(at, 37);  // pieces do not end where records do
    at += piece.size();
    return true;
  };
  try {
    const auto done = drivers::unpack_recording(next, "x", out);
    fuzz::require(fs::exists(out / "metadata.yaml"), "what was unpacked is a bag");
    fuzz::require(done.records > 0, "a bag is made of records");
  } catch (const std::runtime_error&) {
    fuzz::require(!fs::exists(out), "what is refused leaves no bag under its name");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string place = (fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) / "booth-fuzz-XXXXXX";
  if (!::mkdtemp(place.data())) return 0;
  const std::string raw(reinterpret_cast<const char*>(data), size);
  fuzz::Input in(data, size);
  unpack(header() + records(in), fs::path(place) / "a");
  unpack(header() + raw, fs::path(place) / "b");
  unpack(raw, fs::path(place) / "c");
  std::error_code ignored;
  fs::remove_all(place, ignored);
  return 0;
}
