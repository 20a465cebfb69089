// A session's folder whose files are what the input says: frames, or one sentence.
#include <stdexcept>
#include <string>

#include "daemon/io/csv_file.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/record/session_reader.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth;
using fuzz::require;

void read(const std::filesystem::path& folder) {
  try {
    const auto contents = daemon::read_session(folder);
    for (const auto& frame : contents.frames) require(frame.shape_count <= daemon::kRecordShape, "a body has no more numbers than there is room for");
  } catch (const std::runtime_error& e) {
    require(e.what()[0] != '\0', "what is wrong is said");
  }
}

/// A log as boothd writes it, one frame long.
const std::string& log_bytes() {
  static const std::string bytes = [] {
    const fuzz::Scratch scratch;
    {
      daemon::SessionLog log;
      log.open(scratch.path());
      daemon::FrameRecord record{};
      record.captured_ns = 1;
      log.append(record);
      log.close();
    }
    std::ifstream in(scratch.path() / daemon::kFrameLogName, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  }();
  return bytes;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::Scratch scratch;
  fuzz::Input in(data, size);
  const unsigned choice = in.u8() % 4;
  const auto rest = in.bytes(size);
  const std::string bytes(reinterpret_cast<const char*>(rest.data()), rest.size());
  std::error_code ignored;
  for (const char* name : {daemon::kFrameLogName, "skeleton.csv", "session.json"}) std::filesystem::remove(scratch.path() / name, ignored);
  scratch.put("session.json", choice == 0 ? bytes : R"({"result":"complete","sex":"men","beta":[0.5,-1]})");
  if (choice == 0) scratch.put("skeleton.csv", daemon::skeleton_csv_header());
  if (choice == 1) scratch.put(daemon::kFrameLogName, bytes);
  if (choice == 2) {  // bytes in the middle of a good one
    std::string log = log_bytes();
    if (bytes.size() > 2) {
      const std::size_t at = (static_cast<std::size_t>(static_cast<unsigned char>(bytes[0])) << 8 | static_cast<unsigned char>(bytes[1])) % log.size();
      for (std::size_t i = 2; i < bytes.size() && at + i - 2 < log.size(); ++i) log[at + i - 2] = bytes[i];
    }
    scratch.put(daemon::kFrameLogName, log);
  }
  if (choice == 3) scratch.put("skeleton.csv", daemon::skeleton_csv_header() + bytes);
  read(scratch.path());
  return 0;
}
