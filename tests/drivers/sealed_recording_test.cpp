// Recordings that are sealed while they are written: message for message the bag that would have been there, cut at any place still a bag, and nothing to read
// for anybody else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>
#include <random>
#include <thread>

#include "daemon/seal/sealed_file.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/recording/bag_file.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/flight_recorder.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/recording/rvl.hpp"
#include "drivers/recording/sealed_recording.hpp"
#include "tests/conformance/sources.hpp"

namespace booth::drivers {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::vector<hal::CameraDescription> cameras() {
  std::vector<hal::CameraDescription> out(2);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].name = "c-" + std::to_string(i);
    out[i].intrinsics = {.width = 32, .height = 24, .fx = 30.1, .fy = 30, .cx = 16, .cy = 12, .distortion = {0.01, 0, 0, 0, 0}};
  }
  return out;
}

std::vector<std::uint16_t> picture(unsigned number) {
  std::mt19937 random(number);
  std::vector<std::uint16_t> out(32 * 24);
  for (auto& d : out) d = static_cast<std::uint16_t>(random() % 5 ? 1000 + random() % 100 : 0);
  return out;
}

/// The same moments, wherever they go.
void fill(RecordingSink& sink, std::uint64_t frames, bool depth) {
  std::vector<std::byte> packed(rvl_bound(32 * 24));
  const hal::Nanoseconds offset(1'767'225'600'000'000'000);
  sink.event("{\"kind\":\"recording\"}", hal::UtcTime(offset));
  for (std::uint64_t n = 0; n < frames; ++n) {
    const hal::Nanoseconds at(static_cast<std::int64_t>(n) * 33'000'000 + 1);
    for (std::size_t c = 0; depth && c < 2; ++c)
      sink.depth(c, {packed.data(), rvl_pack(picture(static_cast<unsigned>(2 * n + c)), packed.data())}, hal::UtcTime(offset + at));
    hal::FittedGroup g;
    g.sequence = n;
    g.reference = hal::MonotonicTime(at);
    g.captured = {g.reference, g.reference + 3ms};
    g.q[5] = 0.1 * static_cast<double>(n);
    g.person = true;
    sink.group(g, offset);
  }
}

/// Every message of a bag: topic, time, bytes.
std::vector<std::string> messages(const fs::path& bag) {
  std::vector<std::string> out;
  for (const auto& file : fs::directory_iterator(bag)) {
    if (file.path().extension() != ".db3") continue;
    sqlite3* db = nullptr;
    EXPECT_EQ(sqlite3_open_v2(file.path().c_str(), &db, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
    sqlite3_stmt* s = nullptr;
    EXPECT_EQ(
        sqlite3_prepare_v2(db, "SELECT name, type, timestamp, data FROM messages JOIN topics ON topics.id = topic_id ORDER BY messages.id", -1, &s, nullptr),
        SQLITE_OK);
    while (sqlite3_step(s) == SQLITE_ROW) {
      std::string row = reinterpret_cast<const char*>(sqlite3_column_text(s, 0));
      row += " " + std::string(reinterpret_cast<const char*>(sqlite3_column_text(s, 1))) + " " + std::to_string(sqlite3_column_int64(s, 2)) + " ";
      row.append(static_cast<const char*>(sqlite3_column_blob(s, 3)), static_cast<std::size_t>(sqlite3_column_bytes(s, 3)));
      out.push_back(std::move(row));
    }
    sqlite3_finalize(s);
    sqlite3_close(db);
  }
  return out;
}

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

struct SealedRecording : ::testing::Test {
  tests::ScratchFolder scratch;
  const daemon::PrivateKey key = daemon::make_private_key();
  const hal::SealFiles seal = daemon::seal_files(key.public_half);

  std::vector<hal::DepthFrame> background() {
    hal::DepthFrame f;
    f.camera = static_cast<hal::CameraIndex>(1);
    f.depth = picture(77);
    return {f};
  }
  fs::path recorded(const char* name, bool sealed, BagContents contents, std::uint64_t frames = 40) {
    const auto sink = make_recording_sink(scratch.path() / name, cameras(), background(), contents, sealed ? seal : hal::SealFiles{});
    fill(*sink, frames, contents.depth);
    sink->close();
    return scratch.path() / name;
  }
  Unpacked open(const fs::path& folder, const char* out) {
    const auto opened = daemon::open_seal(folder, key);
    daemon::SealedReader in(folder, kSealedRecording, *opened);
    end = daemon::SealEnd::open;
    const Unpacked done = unpack_recording([&](std::string& piece) { return in.next(piece); }, "stream", scratch.path() / out);
    end = in.end();
    return done;
  }
  daemon::SealEnd end{};
};

TEST_F(SealedRecording, OpenedItIsTheBagThatWouldHaveBeenThere) {
  const BagContents kinds[] = {{.compressed = true, .depth = true, .groups = true},
                               {.compressed = false, .depth = true, .groups = true},
                               {.compressed = true, .depth = false, .groups = true}};
  int number = 0;
  for (const BagContents& contents : kinds) {
    const std::string n = std::to_string(number++);
    const auto plain = recorded(("plain" + n).c_str(), false, contents), sealed = recorded(("sealed" + n).c_str(), true, contents);
    const Unpacked done = open(sealed, ("open" + n).c_str());
    EXPECT_FALSE(done.torn);
    EXPECT_EQ(end, daemon::SealEnd::complete);
    EXPECT_EQ(messages(scratch.path() / ("open" + n)), messages(plain));
    EXPECT_GT(messages(plain).size(), 80u);
    EXPECT_EQ(bytes_of(scratch.path() / ("open" + n) / "calibration.toml"), bytes_of(plain / "calibration.toml"));
  }
}

TEST_F(SealedRecording, SaysWhatItIsAndShowsNothing) {
  const auto sealed = recorded("sealed", true, {.compressed = true, .depth = true, .groups = true});
  for (const auto& file : fs::directory_iterator(sealed)) {
    EXPECT_TRUE(file.path().filename() == "seal.key" || file.path().filename() == "recording.sealed") << file.path();
    EXPECT_EQ(bytes_of(file.path()).find("camera"), std::string::npos) << file.path();
  }
  try {
    (void)open_recording(sealed, Pace::fast, std::make_shared<SystemClock>());
    FAIL() << "nobody reads it";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("boothctl decrypt"));
  }
}

TEST_F(SealedRecording, CutAnywhereItIsStillABag) {
  const auto sealed = recorded("sealed", true, {.compressed = true, .depth = true, .groups = true}, 200);
  const std::string whole = bytes_of(sealed / "recording.sealed");
  const std::size_t all = (open(sealed, "whole"), messages(scratch.path() / "whole").size());
  std::size_t before = 0;
  for (int i = 1; i <= 12; ++i) {
    fs::resize_file(sealed / "recording.sealed", whole.size() * static_cast<std::size_t>(i) / 13);
    const std::string out = "cut" + std::to_string(i);
    open(sealed, out.c_str());
    EXPECT_EQ(end, daemon::SealEnd::cut);
    const std::size_t there = messages(scratch.path() / out).size();
    EXPECT_GE(there, before);
    EXPECT_LT(there, all);
    before = there;
    std::ofstream(sealed / "recording.sealed", std::ios::binary) << whole;
  }
  EXPECT_GT(before, all / 2);
}

TEST_F(SealedRecording, TheRecorderSealsAndADeadOnesIsGivenItsName) {
  SystemClock clock;
  {
    FlightRecorderSettings settings;
    settings.directory = scratch.path() / "recordings";
    settings.depth = true;
    settings.memory_bytes = 8 << 20;
    settings.keep_free_bytes = 0;
    settings.seal = seal;
    const auto recorder = make_flight_recorder(settings, cameras(), {}, clock);
    for (unsigned n = 0; n < 10; ++n) {
      hal::DepthFrame f;
      f.captured = clock.now();
      f.depth = picture(n);
      recorder->frame(f);
      std::this_thread::sleep_for(8ms);
    }
    ASSERT_EQ(recorder->snapshot("test"), "");
    for (int turn = 0; turn < 5000 && recorder->status(false).snapshot.running; ++turn) std::this_thread::sleep_for(2ms);
    EXPECT_EQ(recorder->status(false).snapshot.problem, "");
    const fs::path path = recorder->status(false).snapshot.path;
    EXPECT_TRUE(is_sealed_recording(path)) << path;
    open(path, "snapshot");
    EXPECT_EQ(end, daemon::SealEnd::complete);
    EXPECT_GE(messages(scratch.path() / "snapshot").size(), 10u);
  }
  // What a kill in the middle leaves: a folder with a temporary name, and a stream without an end.
  const fs::path place = scratch.path() / "left";
  fs::create_directory(place);
  {
    const auto sink = make_recording_sink(place / "20260101T000000Z-0001-record", cameras(), {}, {.compressed = true, .depth = true, .groups = true}, seal);
    fill(*sink, 100, true);
  }
  const auto said = recover_bags(place);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("it is sealed"));
  const fs::path whole = place / "20260101T000000Z-0001-record";
  EXPECT_TRUE(fs::exists(whole / "interrupted.txt"));
  open(whole, "recovered");
  EXPECT_EQ(end, daemon::SealEnd::cut);
  EXPECT_GT(messages(scratch.path() / "recovered").size(), 1u);
}

TEST_F(SealedRecording, AStreamOfNonsenseIsOneSentenceAndNoBag) {
  const auto complaint = [&](std::string stream) {
    try {
      bool given = false;
      unpack_recording(
          [&](std::string& piece) {
            piece = stream;
            return !std::exchange(given, true);
          },
          "stream", scratch.path() / "x");
    } catch (const std::runtime_error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const auto record = [](char kind, const std::string& contents) {
    std::string out;
    for (int i = 0; i < 4; ++i) out += static_cast<char>(contents.size() >> (8 * i) & 0xff);
    return out + kind + contents;
  };
  const std::string header = record(1, std::string("\x01\x05", 2) + calibration_text(cameras()));
  EXPECT_EQ(complaint(""), "stream: holds nothing");
  EXPECT_EQ(complaint(record(3, std::string(20, 'x'))), "stream: does not begin with its header");
  EXPECT_THAT(complaint(record(1, "\x02\x05zzz")), HasSubstr("another version"));
  EXPECT_THAT(complaint(record(1, std::string("\x01\x05", 2) + "[[camera")), HasSubstr("stream: cameras: line 1"));
  EXPECT_EQ(complaint(header + header), "stream: has two headers");
  EXPECT_EQ(complaint(header + record(3, std::string(20, '\x07'))), "stream: names a camera that it does not have");
  EXPECT_EQ(complaint(header + record(4, "short")), "stream: holds a record that is too short");
  EXPECT_EQ(complaint(header + record(9, "what")), "stream: holds a record of a kind that this version does not know");
  EXPECT_EQ(complaint(std::string("\xff\xff\xff\xff\x03", 5)), "stream: holds a record that is too long");
  EXPECT_FALSE(fs::exists(scratch.path() / "x"));
}

}  // namespace
}  // namespace booth::drivers
