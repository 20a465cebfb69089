// Broken and hostile recordings: one clear sentence or a counted loss, never a crash.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/recording/bag_file.hpp"
#include "drivers/recording/cdr_reader.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/recording/sqlite.hpp"
#include "drivers/recording/text.hpp"
#include "drivers/recording/truth_file.hpp"
#include "fit/body/skeleton.hpp"
#include "tests/conformance/sources.hpp"

namespace booth::tests {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

std::string contents_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void put(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

void replace(const fs::path& path, const std::string& what, const std::string& with) {
  std::string text = contents_of(path);
  const auto at = text.find(what);
  ASSERT_NE(at, std::string::npos) << what;
  put(path, text.replace(at, what.size(), with));
}

/// The sentence with which opening fails; empty when it succeeds.
std::string complaint(const fs::path& path) {
  try {
    drivers::open_recording(path, drivers::Pace::fast, std::make_shared<drivers::ManualClock>());
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return {};
}

hal::CameraCounters play(const fs::path& path) {
  const auto source = drivers::open_recording(path, drivers::Pace::fast, std::make_shared<drivers::ManualClock>());
  hal::DepthFrame frame;
  source.cameras[0]->start();
  while (source.cameras[0]->read(frame, 1s) == hal::ReadStatus::frame) {
  }
  return source.cameras[0]->counters();
}

class HostileFolder : public testing::Test {
 protected:
  const ScratchFolder scratch_;
  const fs::path path_ = record_scene(scratch_, Kind::folder, 7);
  const fs::path calibration_ = path_ / "calibration.toml";
};

TEST_F(HostileFolder, LosesOnlyTheFramesThatAreMissingOrBroken) {
  const fs::path frames = path_ / "camera-0";
  fs::remove(frames / "depth_000003.png");
  fs::resize_file(frames / "depth_000005.png", fs::file_size(frames / "depth_000005.png") / 2);
  put(frames / "depth_000007.png", "this is no picture");
  put(frames / "depth_000008.png", "");
  const auto c = play(path_);
  EXPECT_EQ(c.delivered, static_cast<std::uint64_t>(kSceneFrames - 4));
  EXPECT_EQ(c.dropped, 1u);
  EXPECT_EQ(c.corrupt, 3u);
}

TEST_F(HostileFolder, NamesFileLineAndRemedyOfWhatIsWrong) {
  struct Case {
    const char *what, *with, *expected;
  };
  const std::string good = contents_of(calibration_);
  for (const Case& c :
       {Case{"fx = 365.5", "fx = nan", "fx"}, Case{"fx = 365.5", "fx = -1.0", "fx"}, Case{"fx = 365.5", "fx = \"wide\"", "line"},
        Case{"width = 512", "width = 99999999", "width"}, Case{"width = 512", "width = 4", "pixels"},
        Case{"camera_to_world = [", "camera_to_world = [[1.0],", "camera_to_world"}, Case{"folder = \"camera-0\"", "folder = \"../..\"", "leads out"},
        Case{"depth_scale = 0.001", "depth_scale = 0.0", "depth_scale"}, Case{"[[camera]]", "[[camera", "line"}, Case{"\"background_0.png\"", "12345", "12345"},
        Case{"\"background_0.png\"", "\"../../x.png\"", "background"}}) {
    put(calibration_, good);
    replace(calibration_, c.what, c.with);
    const std::string said = complaint(path_);
    EXPECT_NE(said.find("calibration.toml"), std::string::npos) << c.with << " -> " << said;
    EXPECT_NE(said.find(c.expected), std::string::npos) << c.with << " -> " << said;
  }
}

TEST_F(HostileFolder, RefusesAMirroredCamera) {
  // The second camera looks along -x; turning its first row around makes its axes left-handed.
  replace(calibration_, "[0.0, 0.0, -1.0, 2.6]", "[0.0, 0.0, 1.0, 2.6]");
  EXPECT_NE(complaint(path_).find("right-handed"), std::string::npos) << complaint(path_);
}

TEST_F(HostileFolder, RefusesAnIndexThatLiesAboutTimeOrPlace) {
  const fs::path index = path_ / "camera-0" / "depth.txt";
  for (const auto& [line, expected] : std::vector<std::pair<std::string, std::string>>{{"1.0 a.png\n0.5 b.png\n", "line 2"},
                                                                                       {"nan a.png\n", "line 1"},
                                                                                       {"1.0 /etc/passwd\n", "leads out"},
                                                                                       {"1.0 ../../secret.png\n", "leads out"},
                                                                                       {"1.0\n", "line 1"}}) {
    put(index, line);
    EXPECT_NE(complaint(path_).find(expected), std::string::npos) << line << " -> " << complaint(path_);
  }
  fs::remove(index);
  EXPECT_NE(complaint(path_).find("depth.txt"), std::string::npos);
}

TEST_F(HostileFolder, RefusesBrokenTruth) {
  const std::string good = contents_of(path_ / "truth.csv");
  put(path_ / "truth.csv", good + "1.0,2.0\n");
  EXPECT_NE(complaint(path_).find("truth.csv"), std::string::npos);
  put(path_ / "truth.csv", "timestamp,q0\n");
  EXPECT_NE(complaint(path_).find("q1"), std::string::npos);
  put(path_ / "truth.csv", good);
  EXPECT_EQ(complaint(path_), "");
  const std::string ply = contents_of(path_ / "truth.ply");
  put(path_ / "truth.ply", ply.substr(0, ply.size() / 2));
  EXPECT_NE(complaint(path_).find("ends too early"), std::string::npos);
  put(path_ / "truth.ply", ply);
  replace(path_ / "truth.ply", "element vertex ", "element vertex 9999999");
  EXPECT_NE(complaint(path_).find("truth.ply"), std::string::npos);
}

class HostileBag : public testing::Test {
 protected:
  void execute(const char* sql) const {
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open(file_.c_str(), &db), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(db);
    sqlite3_close(db);
  }
  const ScratchFolder scratch_;
  const fs::path path_ = record_scene(scratch_, Kind::rosbag2, 7);
  const fs::path file_ = path_ / "rosbag2-7_0.db3";
};

TEST_F(HostileBag, CountsImagesThatAreCutOrLieAboutTheirSize) {
  execute(
      "UPDATE messages SET data = substr(data, 1, 5000) WHERE id IN (SELECT id FROM messages WHERE topic_id = 1 ORDER BY id LIMIT 1 OFFSET 2);"
      "UPDATE messages SET data = x'' WHERE id IN (SELECT id FROM messages WHERE topic_id = 1 ORDER BY id LIMIT 1 OFFSET 4);"
      // A text of four thousand million characters where the frame's name should be.
      "UPDATE messages SET data = substr(data, 1, 12) || x'ffffffff' || substr(data, 17) WHERE id IN (SELECT id FROM messages WHERE topic_id = 1 ORDER BY id "
      "LIMIT 1 OFFSET 6);");
  const auto c = play(path_);
  EXPECT_EQ(c.corrupt, 3u);
  EXPECT_EQ(c.delivered, static_cast<std::uint64_t>(kSceneFrames - 3));
}

TEST_F(HostileBag, SaysWhatIsMissing) {
  execute("DELETE FROM messages WHERE topic_id = (SELECT id FROM topics WHERE name = '/tf_static')");
  EXPECT_NE(complaint(path_).find("tf_static"), std::string::npos);
  execute("DELETE FROM messages WHERE topic_id IN (SELECT id FROM topics WHERE name LIKE '%camera_info')");
  EXPECT_NE(complaint(path_).find("camera_info"), std::string::npos);
  execute("DELETE FROM messages");
  EXPECT_NE(complaint(path_).find("no topic"), std::string::npos);
  execute("DROP TABLE messages");
  EXPECT_NE(complaint(path_).find("messages"), std::string::npos);
}

TEST_F(HostileBag, AViewThatNeverEndsIsNoTable) {
  execute("ALTER TABLE messages RENAME TO stolen");
  execute(
      "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x AS id, 9 AS topic_id, 0 AS timestamp, x'00' AS data "
      "FROM c");
  EXPECT_NE(complaint(path_).find("messages is a view"), std::string::npos) << complaint(path_);
}

TEST_F(HostileBag, WhatIsComputedOrHasNoKeyIsNoTableOfMessages) {
  execute("ALTER TABLE messages RENAME TO stolen");
  for (const auto& [table, expected] : std::vector<std::pair<const char*, const char*>>{
           {"CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)", "messages is a virtual"},
           {"CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data AS (printf('%.*c', 90000000, 'x')))",
            "column data of messages is computed"},
           {"CREATE TABLE messages(id INTEGER, topic_id, timestamp, data)", "id is not the key of messages"}}) {
    execute(table);
    EXPECT_NE(complaint(path_).find(expected), std::string::npos) << complaint(path_);
    execute("DROP TABLE messages");
  }
}

/// Turns the table of messages into a tree of five levels in which every branch leads to the same page: a few kilobytes that hold 500^5 rows.
void grow_endless(const fs::path& file, std::size_t root) {
  constexpr std::size_t kPage = 4096, kBranches = 500;
  std::string bytes = contents_of(file);
  const auto big_endian = [](std::size_t v) {
    return std::string{static_cast<char>(v >> 24), static_cast<char>(v >> 16), static_cast<char>(v >> 8), static_cast<char>(v)};
  };
  const auto branches_to = [&](std::size_t page) {
    constexpr std::size_t kCell = 5, kStart = kPage - kCell * kBranches;
    std::string out = "\x05";
    out += std::string(2, '\0') + big_endian(kBranches).substr(2) + big_endian(kStart).substr(2) + '\0' + big_endian(page);
    for (std::size_t i = 0; i < kBranches; ++i) out += big_endian(kStart + kCell * i).substr(2);
    out.resize(kStart, '\0');
    for (std::size_t i = 0; i < kBranches; ++i) out += big_endian(page) + '\x01';
    return out;
  };
  bytes += bytes.substr((root - 1) * kPage, kPage);  // the leaf
  for (int level = 0; level < 4; ++level) bytes += branches_to(bytes.size() / kPage);
  bytes.replace((root - 1) * kPage, kPage, branches_to(bytes.size() / kPage));
  bytes.replace(28, 4, big_endian(bytes.size() / kPage));
  put(file, bytes);
}

TEST(Recording, ATreeThatCountsItsPagesManyTimesHasAnEnd) {
  const ScratchFolder scratch;
  const fs::path bag = scratch.path() / "e", file = bag / "e_0.db3", partial = scratch.path() / "e.partial-123456";
  {
    drivers::BagFile made(bag);
    const std::size_t topic = made.add_topic("/t", "std_msgs/msg/String", false);
    for (int n = 0; n < 3; ++n) made.insert(topic, hal::UtcTime(std::chrono::seconds(n)), "t");
    made.close();
  }
  std::size_t root = 0;
  {
    const drivers::Database db = drivers::open_database(file, SQLITE_OPEN_READONLY);
    root = static_cast<std::size_t>(drivers::number_of(db, file, "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"));
  }
  grow_endless(file, root);
  EXPECT_NE(complaint(bag).find("more messages than it has room for"), std::string::npos) << complaint(bag);
  fs::rename(bag, partial);
  const std::string said = drivers::recover_bag(partial);
  EXPECT_NE(said.find("more messages than it has room for"), std::string::npos) << said;
  EXPECT_TRUE(fs::exists(partial / "e_0.db3"));
}

TEST_F(HostileBag, RefusesTruncatedFilesAndForeignStorage) {
  const std::string metadata = contents_of(path_ / "metadata.yaml");
  replace(path_ / "metadata.yaml", "storage_identifier: sqlite3", "storage_identifier: mcap");
  EXPECT_NE(complaint(path_).find("mcap"), std::string::npos);
  put(path_ / "metadata.yaml", "no yaml at all");
  EXPECT_FALSE(complaint(path_).empty());
  put(path_ / "metadata.yaml", metadata);
  // Cut anywhere, it opens with losses or says why not; what must not happen is a crash.
  const auto size = fs::file_size(file_);
  for (const auto part : {size / 2, size / 10, std::uintmax_t{5000}, std::uintmax_t{100}, std::uintmax_t{0}}) {
    fs::resize_file(file_, part);
    if (complaint(path_).empty()) {
      EXPECT_LT(play(path_).delivered, static_cast<std::uint64_t>(kSceneFrames));
    }
  }
}

TEST(Recording, ANameThatIsTakenOrNoRecordingIsSaid) {
  const ScratchFolder scratch;
  EXPECT_NE(complaint(scratch.path()).find("neither"), std::string::npos);
  EXPECT_NE(complaint(scratch.path() / "nothing").find("not a folder"), std::string::npos);
  EXPECT_THROW(drivers::create_recording(scratch.path(), drivers::Layout::folder, scene_settings(1).cameras), std::runtime_error);
  EXPECT_THROW(drivers::create_recording(scratch.path() / "no" / "such" / "folder", drivers::Layout::rosbag2, scene_settings(1).cameras), std::runtime_error);
}

TEST(Recording, HasNoNameUntilItIsClosed) {
  const ScratchFolder scratch;
  for (const auto layout : {drivers::Layout::folder, drivers::Layout::rosbag2}) {
    const auto path = scratch.path() / (layout == drivers::Layout::folder ? "folder" : "bag");
    hal::DepthFrame frame;
    frame.depth.resize(512 * 424, 1234);
    {
      const auto unfinished = drivers::create_recording(path, layout, scene_settings(1).cameras);
      unfinished->write(frame, hal::UtcTime(1s));
      EXPECT_FALSE(fs::exists(path));
    }
    EXPECT_FALSE(fs::exists(path)) << "a recording that was not closed must not look complete";
    const auto sink = drivers::create_recording(path, layout, scene_settings(1).cameras);
    sink->write(frame, hal::UtcTime(5s));
    sink->write(frame, hal::UtcTime(4s));  // the wall clock was set back
    frame.depth.resize(10);
    EXPECT_THROW(sink->write(frame, hal::UtcTime(6s)), std::runtime_error);
    sink->close();
    EXPECT_EQ(play(path).delivered, 2u);
  }
}

TEST(TruthFile, NamesTheJointsAsTheFitDoes) {
  for (int j = 0; j < fit::kJoints; ++j)
    EXPECT_EQ(drivers::truth_joint_names()[static_cast<std::size_t>(j)], fit::bones()[static_cast<std::size_t>(j)].end_joint);
}

TEST(CdrReader, NeverReadsBeyondTheMessage) {
  for (std::size_t size = 0; size < 24; ++size) {
    std::vector<std::byte> bytes(size, std::byte{0xff});
    if (size >= 2) bytes[0] = std::byte{0}, bytes[1] = std::byte{1};
    drivers::CdrReader in(bytes);
    in.get<std::int32_t>();
    in.text();
    in.octets();
    in.get<double>();
    EXPECT_FALSE(in.ok());
  }
}

TEST(Text, SecondsKeepEveryNanosecond) {
  EXPECT_EQ(drivers::parse_seconds("1703695509.622443")->time_since_epoch().count(), 1703695509622443000);
  EXPECT_EQ(drivers::parse_seconds("7")->time_since_epoch().count(), 7000000000);
  EXPECT_EQ(drivers::format_seconds(*drivers::parse_seconds("1703695509.000000001")), "1703695509.000000001");
  for (const char* bad : {"", "x", "1.2.3", "-5", "1e9", "99999999999999"}) EXPECT_FALSE(drivers::parse_seconds(bad).has_value()) << bad;
}

}  // namespace
}  // namespace booth::tests
