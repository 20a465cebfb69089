// A session's folder whose files are what the input says: frames, or one sentence.
#include <fmt/format.h>

#include <fstream>
#include <stdexcept>
#include <string>

#include "daemon/io/csv_file.hpp"
#include "daemon/record/session_files.hpp"
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

/// What boothd does with it at its next start: nothing that lies there may keep it from starting.
void close(const std::filesystem::path& directory) {
  for (const auto& line : daemon::close_interrupted_sessions(directory, {})) require(!line.empty(), "what became of it is said");
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
  static const fuzz::Scratch sessions;
  static const std::filesystem::path folder = sessions.path() / "20260101T000000Z-0001";
  fuzz::Input in(data, size);
  const unsigned head = in.u8(), choice = head % 4;
  const auto rest = in.bytes(size);
  const std::string bytes(reinterpret_cast<const char*>(rest.data()), rest.size());
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  std::filesystem::create_directory(folder);
  const auto put = [&](const char* name, std::string_view text) { std::ofstream(folder / name, std::ios::binary) << text; };
  put("session.json", choice == 0 ? bytes : fmt::format(R"({{"result":"{}","sex":"men","beta":[0.5,-1]}})", (head & 4) != 0 ? "running" : "complete"));
  if (choice == 0) put("skeleton.csv", daemon::skeleton_csv_header());
  if (choice == 1) put(daemon::kFrameLogName, bytes);
  if (choice == 2) {  // bytes in the middle of a good one
    std::string log = log_bytes();
    if (bytes.size() > 2) {
      const std::size_t at = (static_cast<std::size_t>(static_cast<unsigned char>(bytes[0])) << 8 | static_cast<unsigned char>(bytes[1])) % log.size();
      for (std::size_t i = 2; i < bytes.size() && at + i - 2 < log.size(); ++i) log[at + i - 2] = bytes[i];
    }
    put(daemon::kFrameLogName, log);
  }
  if (choice == 3) put("skeleton.csv", daemon::skeleton_csv_header() + bytes);
  read(folder);
  close(sessions.path());
  return 0;
}
