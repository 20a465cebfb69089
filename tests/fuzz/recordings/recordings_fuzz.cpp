// Recordings of which one file is what the input says: opened and played to the end with counted losses, or refused with one sentence.
#include <sqlite3.h>

#include <stdexcept>
#include <string>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/recording/truth_file.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

namespace fs = std::filesystem;
using namespace booth;
using namespace std::chrono_literals;
using fuzz::require;

constexpr int kSide = 8;

/// A small recording of each layout, as our own writers make them.
struct Templates {
  Templates() {
    for (const auto layout : {drivers::Layout::folder, drivers::Layout::rosbag2}) {
      hal::CameraDescription camera;
      camera.name = "a";
      camera.intrinsics = {.width = kSide, .height = kSide, .fx = 8, .fy = 8, .cx = 4, .cy = 4, .distortion = {}};
      hal::DepthFrame frame;
      frame.depth.assign(kSide * kSide, 2000);
      const fs::path place = path(layout);
      const auto sink = drivers::create_recording(place, layout, {camera}, {}, {frame});
      for (int i = 1; i <= 3; ++i) sink->write(frame, hal::UtcTime(std::chrono::milliseconds(33 * i)));
      sink->write_truth(hal::UtcTime(33ms), {});
      sink->close();
    }
    for (const auto& entry : fs::directory_iterator(path(drivers::Layout::rosbag2)))
      if (entry.path().extension() == ".db3") database = entry.path().filename();
  }
  fs::path path(drivers::Layout layout) const { return scratch.path() / (layout == drivers::Layout::folder ? "folder" : "bag"); }

  fuzz::Scratch scratch;
  fs::path database;
};

const Templates& templates() {
  static const Templates made;
  return made;
}

void play(const fs::path& recording) {
  try {
    const auto source = drivers::open_recording(recording, drivers::Pace::fast, std::make_shared<drivers::ManualClock>());
    for (const auto& camera : source.cameras) {
      const auto& k = camera->description().intrinsics;
      hal::DepthFrame frame;
      camera->start();
      for (int i = 0; i < 100 && camera->read(frame, 1ms) == hal::ReadStatus::frame; ++i)
        require(frame.depth.size() == static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height), "a picture has the camera's size");
      camera->stop();
    }
  } catch (const std::runtime_error& e) {
    require(e.what()[0] != '\0', "what is wrong is said");
  }
}

/// Replaces the message or the row that the input names.
void work_on(const fs::path& file, fuzz::Input& in) {
  sqlite3* db = nullptr;
  if (sqlite3_open(file.c_str(), &db) != SQLITE_OK) return;
  static constexpr std::array kStatements{"UPDATE messages SET data = ? WHERE id = ?",     "UPDATE topics SET name = ? WHERE id = ?",
                                          "UPDATE topics SET type = ? WHERE id = ?",       "UPDATE messages SET timestamp = ? WHERE id = ?",
                                          "UPDATE messages SET topic_id = ? WHERE id = ?", "UPDATE topics SET id = ? WHERE id = ?"};
  sqlite3_exec(db, "PRAGMA synchronous=OFF; PRAGMA journal_mode=OFF", nullptr, nullptr, nullptr);
  for (int edits = 0; edits < 4 && !in.empty(); ++edits) {
    const unsigned which = in.u8() % kStatements.size();
    const int id = in.u8() % 12;
    sqlite3_stmt* s = nullptr;
    if (sqlite3_prepare_v2(db, kStatements[which], -1, &s, nullptr) == SQLITE_OK) {
      const auto bytes = in.bytes(in.u8());
      if (which == 0)
        sqlite3_bind_blob(s, 1, bytes.data(), static_cast<int>(bytes.size()), SQLITE_TRANSIENT);
      else if (which < 3)
        sqlite3_bind_text(s, 1, reinterpret_cast<const char*>(bytes.data()), static_cast<int>(bytes.size()), SQLITE_TRANSIENT);
      else
        sqlite3_bind_int64(s, 1, static_cast<std::int64_t>(std::uint64_t{in.u32()} << 32 | in.u32()));
      sqlite3_bind_int(s, 2, id);
      sqlite3_step(s);
    }
    sqlite3_finalize(s);
  }
  sqlite3_close(db);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Templates& made = templates();
  fuzz::Input in(data, size);
  const unsigned choice = in.u8() % 8;
  const bool bag = choice < 3;
  const fs::path copy = made.scratch.path() / "copy";
  std::error_code ignored;
  fs::remove_all(copy, ignored);
  fs::copy(made.path(bag ? drivers::Layout::rosbag2 : drivers::Layout::folder), copy, fs::copy_options::recursive);
  if (choice == 0) {
    work_on(copy / made.database, in);
  } else {
    const auto rest = in.bytes(size);
    const std::string bytes(reinterpret_cast<const char*>(rest.data()), rest.size());
    static const std::array<fs::path, 8> kFiles{"", "metadata.yaml", "", "calibration.toml", "a/depth.txt", "truth.csv", "truth.ply", "a/depth_000001.png"};
    const fs::path file = choice == 2 ? made.database : kFiles[choice];
    std::string before;
    if (std::ifstream old(copy / file, std::ios::binary); old) before.assign(std::istreambuf_iterator<char>(old), {});
    // The input alone, or in the place of what stood somewhere in the file.
    std::string now = bytes;
    if (bytes.size() > 4 && !before.empty() && (bytes[0] & 1) != 0) {
      const std::size_t at = (static_cast<std::size_t>(static_cast<unsigned char>(bytes[1])) << 8 | static_cast<unsigned char>(bytes[2])) % before.size();
      now = before.replace(at, std::min(before.size() - at, static_cast<std::size_t>(static_cast<unsigned char>(bytes[3]))), bytes.substr(4));
    }
    std::ofstream(copy / file, std::ios::binary | std::ios::trunc) << now;
  }
  play(copy);
  return 0;
}
