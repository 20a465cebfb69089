// What a session leaves on disk: complete, or marked interrupted; and what is cleared away.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include <fstream>
#include <functional>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/record/session_files.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/record/session_reader.hpp"
#include "daemon/record/truth_error.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using tests::read_text;
using tests::TemporaryFolder;

constexpr std::int64_t kUtc = 1'767'225'600'000'000'000;  // 2026-01-01

SessionInfo info_at(std::int64_t utc) {
  SessionInfo info;
  info.id = make_session_id(utc);
  info.booth = "b";
  info.began_utc_ns = utc;
  return info;
}

const SessionModels& models() {
  static const SessionModels m{tests::capsule_body(fit::Sex::men), nullptr};
  return m;
}

/// A capsule man who moves along x of the booth.
FrameRecord frame_at(std::uint64_t k) {
  FrameRecord f;
  f.sequence = k;
  f.captured_ns = 1'000'000'000 + static_cast<std::int64_t>(k) * 33'333'333;
  f.captured_utc_ns = kUtc + f.captured_ns;
  f.person = PersonState::tracked;
  f.body_accepted = k >= 2;
  f.shape_count = 2;
  f.residual = 0.01f;
  f.q[1] = 0.9;
  f.q[2] = 0.01 * static_cast<double>(k);  // z forward in the CMU frame
  fit::Kinematics kinematics;
  fit::forward_kinematics(Eigen::Map<const fit::PoseVector>(f.q.data()), models().men->bone_vectors(fit::ShapeVector::Zero(2)), kinematics);
  for (std::size_t j = 0; j < kRecordJoints; ++j) {
    const Eigen::Vector3d p = fit::booth_from_cmu(kinematics.joint.col(static_cast<Eigen::Index>(j)));
    f.joints[j] = {p.x(), p.y(), p.z()};
  }
  return f;
}

std::vector<FrameRecord> frames(std::uint64_t count) {
  std::vector<FrameRecord> out;
  for (std::uint64_t k = 0; k < count; ++k) out.push_back(frame_at(k));
  return out;
}

/// The same man, but 2 cm further to the left.
struct ShiftedTruth final : hal::GroundTruth {
  std::string body_name() const override { return "shifted"; }
  std::string sex() const override { return "men"; }
  static std::uint64_t frame_of(hal::MonotonicTime t) { return static_cast<std::uint64_t>((t.time_since_epoch().count() - 1'000'000'000 + 1000) / 33'333'333); }
  std::optional<hal::TruthSample> at(hal::MonotonicTime t) const override {
    const FrameRecord f = frame_at(frame_of(t));
    hal::TruthSample s;
    s.q = f.q;
    s.joints = f.joints;
    for (auto& joint : s.joints) joint[1] += 0.02;
    return s;
  }
  std::vector<std::array<float, 3>> surface(hal::MonotonicTime t) const override {
    const FrameRecord f = frame_at(frame_of(t));
    fit::Vertices v;
    models().men->posed(fit::ShapeVector::Zero(2), Eigen::Map<const fit::PoseVector>(f.q.data()), v);
    std::vector<std::array<float, 3>> out;
    for (Eigen::Index i = 0; i < v.cols(); ++i) out.push_back({v(2, i), v(0, i) + 0.02f, v(1, i)});
    return out;
  }
  const std::vector<std::array<int, 3>>& faces() const override {
    static const std::vector<std::array<int, 3>> list = [] {
      std::vector<std::array<int, 3>> out;
      const fit::Faces& f = models().men->data().faces;
      for (Eigen::Index i = 0; i < f.cols(); ++i) out.push_back({f(0, i), f(1, i), f(2, i)});
      return out;
    }();
    return list;
  }
};

/// The log of a session of these frames that a power cut has left behind.
std::filesystem::path interrupted(const std::filesystem::path& directory, const std::vector<FrameRecord>& frames) {
  const auto session = create_session_folder(directory, info_at(kUtc));
  SessionLog log;
  log.open(session);
  for (const auto& f : frames) log.append(f);
  log.close();
  EXPECT_EQ(log.written(), frames.size());
  EXPECT_FALSE(log.broken());
  return session;
}

TEST(SessionFiles, ARottenFrameSpoilsNeitherTheOthersNorTheStart) {
  constexpr std::size_t kFrames = 30, kLast = kFrames - 1;
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  using Rot = std::function<void(FrameRecord&)>;
  // A time of years would ask for more poses than there is memory: boothd would be killed at each start.
  const std::vector<std::pair<std::size_t, Rot>> cases{{kLast, [](auto& f) { f.captured_ns += std::int64_t{1} << 50; }},
                                                       {kLast, [](auto& f) { f.captured_ns = std::numeric_limits<std::int64_t>::max(); }},
                                                       {0, [](auto& f) { f.captured_ns += std::int64_t{1} << 50; }},
                                                       {0, [](auto& f) { f.captured_ns = -5; }},
                                                       {9, [](auto& f) { f.captured_ns += std::int64_t{1} << 40; }},
                                                       {9, [](auto& f) { f.captured_ns -= std::int64_t{1} << 29; }},
                                                       {9, [](auto& f) { f.sequence |= std::uint64_t{1} << 60; }},
                                                       {9, [](auto& f) { f.sequence = 0; }},
                                                       {9, [](auto& f) { f.sex = static_cast<RecordSex>(9); }},
                                                       {9, [](auto& f) { f.person = static_cast<PersonState>(77); }},
                                                       {9, [](auto& f) { f.shape_count = 200; }},
                                                       {9, [](auto& f) { f.q[3] = kNothing; }},
                                                       {9, [](auto& f) { f.joints[2][1] = 1e300; }},
                                                       {kLast, [](auto& f) { f.beta[1] = kNothing; }},
                                                       {9, [](auto& f) { f = {}; }}};
  for (std::size_t k = 0; k < cases.size(); ++k) {
    TemporaryFolder folder;
    auto recorded = frames(kFrames);
    cases[k].second(recorded[cases[k].first]);
    const auto session = interrupted(folder.path, recorded);
    const auto said = close_interrupted_sessions(folder.path, models());
    ASSERT_EQ(said.size(), 1u);
    EXPECT_THAT(said[0], HasSubstr("29 frames of it were saved")) << k;
    EXPECT_THAT(said[0], HasSubstr("1 of its 30 frames are damaged")) << k;
    EXPECT_TRUE(std::filesystem::exists(session / kDamagedLogName)) << "what was left out may be read by a person; " << k;
    const SessionContents read = read_session(session);
    EXPECT_EQ(read.frames.size(), kFrames - 1) << k;
    EXPECT_EQ(read.result, "interrupted");
    EXPECT_TRUE(std::filesystem::exists(session / "skeleton.bvh"));
  }
}

TEST(SessionFiles, APauseOfHoursIsNoDamage) {
  TemporaryFolder folder;
  auto recorded = frames(30);
  for (std::size_t i = 10; i < recorded.size(); ++i) recorded[i].captured_ns += 3 * 3600'000'000'000;
  interrupted(folder.path, recorded);
  const auto said = close_interrupted_sessions(folder.path, models());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("; 30 frames of it were saved"));
}

TEST(SessionFiles, AFolderThatCannotBeMadeLeavesNothing) {
  TemporaryFolder folder;
  const SessionInfo info = info_at(kUtc);
  folder.write(info.id, "in the way");  // the rename fails
  EXPECT_THROW(create_session_folder(folder.path, info), std::runtime_error);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path), {}), 1);
}

TEST(SessionFiles, TwoWhoClearAwayTogetherDeleteNoMoreThanOne) {
  for (int turn = 0; turn < 20; ++turn) {
    TemporaryFolder folder;
    for (int i = 0; i < 10; ++i) {
      const auto name = fmt::format("202601{:02}T000000Z-00{:02}", i + 1, i);
      std::filesystem::create_directory(folder.path / name);
      folder.write(name + "/session.json", R"({"result":"complete"})" + std::string(979, ' '));
    }
    std::vector<std::thread> both;
    std::mutex mutex;
    std::string said;
    for (int i = 0; i < 2; ++i)
      both.emplace_back([&] {
        for (const auto& line : prune_sessions(folder.path, 5500, 0, kUtc)) {
          const std::lock_guard lock(mutex);
          said += line + "\n";
        }
      });
    for (auto& one : both) one.join();
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path), {}), 5);
    EXPECT_EQ(said.find("cannot be"), std::string::npos) << said;
  }
}

TEST(SessionFiles, ACompleteSession) {
  TemporaryFolder folder;
  SessionInfo info = info_at(kUtc);
  const auto session = create_session_folder(folder.path / "sessions", info);
  EXPECT_EQ(session.filename().string().substr(0, 17), "20260101T000000Z-");
  struct stat mode {};
  ::stat(session.c_str(), &mode);
  EXPECT_EQ(mode.st_mode & 0777, 0700u) << "bodies are personal data";
  EXPECT_EQ(json::parse(read_text(session / "session.json"))["result"], "running");

  SessionLog log;
  log.open(session);
  auto recorded = frames(40);
  recorded[7].person = PersonState::lost;
  for (const auto& f : recorded) {
    while (true) {  // the ring holds 128; this many always fit
      log.append(f);
      break;
    }
  }
  log.close();
  EXPECT_EQ(log.lost(), 0u);
  const auto read = read_session_log(session);
  ASSERT_EQ(read.size(), 40u);

  info.result = "complete";
  info.state_at_end = "tracking";
  info.groups_dropped = 3;
  const ShiftedTruth truth;
  const SessionSummary summary = finish_session(session, info, read, models(), &truth);
  EXPECT_NEAR(summary.fps, 30, 1e-3);
  EXPECT_NEAR(summary.joint_mean, 0.02, 1e-9);
  const json j = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(j["result"], "complete");
  EXPECT_EQ(j["frames"], 40);
  EXPECT_EQ(j["frames_lost"], 1);
  EXPECT_EQ(j["groups_dropped"], 3);
  EXPECT_EQ(j["state_at_end"], "tracking");
  EXPECT_EQ(j["body_accepted_at_frame"], 2);
  EXPECT_NEAR(j["residual"]["mean"].get<double>(), 0.01, 1e-6);
  EXPECT_EQ(j["truth"]["joints"].size(), 15u);
  EXPECT_EQ(j["truth"]["frames"], 39);
  EXPECT_NEAR(j["truth"]["joint_p95"].get<double>(), 0.02, 1e-6);
  // A tube moved by 2 cm is that far away only on two of its sides; the other way round it is just as far.
  EXPECT_GT(j["truth"]["surface_mean"].get<double>(), 0.005);
  EXPECT_LT(j["truth"]["surface_mean"].get<double>(), 0.02);
  EXPECT_NEAR(j["truth"]["fitted_to_truth"].get<double>(), j["truth"]["truth_to_fitted"].get<double>(), 0.002);
  for (const char* name : {"skeleton.csv", "skeleton.bvh", "body.ply"}) EXPECT_TRUE(std::filesystem::exists(session / name)) << name;
  EXPECT_FALSE(std::filesystem::exists(session / kFrameLogName));
  const std::string csv = read_text(session / "skeleton.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 41);
}

TEST(SessionFiles, WhoeverComesByAtTheEndIsNotWhomTheSessionWasAbout) {
  TemporaryFolder folder;
  const SessionInfo info = info_at(kUtc);
  const auto session = create_session_folder(folder.path / "sessions", info);
  auto recorded = frames(40);
  for (auto& f : recorded) f.beta[0] = 1;
  for (std::size_t k = 32; k < recorded.size(); ++k) recorded[k].beta[0] = -3, recorded[k].body_accepted = false;
  finish_session(session, info, recorded, models(), nullptr);
  json said = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(said["beta"][0], 1.0);
  EXPECT_EQ(said["body_accepted"], true);
  // Whom nobody knew well enough is still better than nobody, and the last look is the best.
  for (auto& f : recorded) f.body_accepted = false;
  finish_session(session, info, recorded, models(), nullptr);
  said = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(said["beta"][0], -3.0);
  EXPECT_EQ(said["body_accepted"], false);
}

TEST(SessionFiles, OfTwoPeopleTheLastAcceptedOneIsTheSessions) {
  TemporaryFolder folder;
  const SessionInfo info = info_at(kUtc);
  const auto session = create_session_folder(folder.path / "sessions", info);
  auto recorded = frames(40);
  for (auto& f : recorded) f.beta[0] = 1;
  // Found again at 10, and known again at 12; from 20 on it is somebody else, known at 25.
  for (std::size_t k = 10; k < 12; ++k) recorded[k].body_accepted = false;
  for (std::size_t k = 12; k < 20; ++k) recorded[k].beta[0] = 1.02;
  finish_session(session, info, {recorded.begin(), recorded.begin() + 20}, models(), nullptr);
  EXPECT_EQ(json::parse(read_text(session / "session.json"))["body_accepted_at_frame"], 2) << "still the same body";
  for (std::size_t k = 20; k < 40; ++k) recorded[k].beta[0] = -3, recorded[k].body_accepted = k >= 25;
  finish_session(session, info, recorded, models(), nullptr);
  const json said = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(said["beta"][0], -3.0);
  EXPECT_EQ(said["body_accepted_at_frame"], 25);
}

TEST(SessionFiles, WhatWasInterruptedIsClosedAsSuch) {
  TemporaryFolder folder;
  const auto session = create_session_folder(folder.path, info_at(kUtc));
  SessionLog log;
  log.open(session);
  for (const auto& f : frames(25)) log.append(f);
  log.close();
  // The power went away in the middle of a record.
  std::filesystem::resize_file(session / kFrameLogName, std::filesystem::file_size(session / kFrameLogName) - 100);
  std::filesystem::create_directory(folder.path / ".20260101T000001Z-0000.part");

  const auto said = close_interrupted_sessions(folder.path, models());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("was interrupted; 24 frames of it were saved"));
  const json j = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(j["result"], "interrupted");
  EXPECT_EQ(j["frames"], 24);
  EXPECT_EQ(j["booth"], "b");
  EXPECT_TRUE(std::filesystem::exists(session / "skeleton.bvh"));
  EXPECT_FALSE(std::filesystem::exists(folder.path / ".20260101T000001Z-0000.part"));
  EXPECT_TRUE(close_interrupted_sessions(folder.path, models()).empty()) << "once is enough";
}

TEST(SessionFiles, SayHowMuchOfTheBodyWasSeen) {
  struct Case {
    float coverage;
    std::uint8_t cameras;
    const char* word;
  };
  for (const Case& c : {Case{0.85f, 4, "full"}, Case{0.55f, 4, "partial"}, Case{0.9f, 1, "partial"}, Case{0.71f, 2, "full"}}) {
    TemporaryFolder folder;
    auto recorded = frames(4);
    for (auto& f : recorded) f.coverage = c.coverage, f.cameras = c.cameras;
    recorded[1].person = PersonState::lost, recorded[1].coverage = 0;
    const SessionSummary summary = finish_session(create_session_folder(folder.path, info_at(kUtc)), info_at(kUtc), recorded, models(), nullptr);
    const json j = json::parse(summary.json);
    EXPECT_EQ(j["coverage"], c.word) << c.coverage;
    EXPECT_NEAR(j["coverage_fraction"].get<double>(), static_cast<double>(c.coverage), 1e-4) << "frames without a person do not count";
    EXPECT_EQ(summary.partial, j["coverage"] == "partial");
  }
  TemporaryFolder folder;
  const json nobody = json::parse(finish_session(create_session_folder(folder.path, info_at(kUtc)), info_at(kUtc), {}, models(), nullptr).json);
  EXPECT_FALSE(nobody.contains("coverage"));
}

CalibrationUsed calibration() {
  return {.source = CalibrationUsed::Source::file,
          .file = "/var/lib/boothd/calibration.toml",
          .utc = "2026-11-28T09:00:00Z",
          .checksum = "crc64:0f1e2d3c4b5a6978",
          .held_out_corner = 0.0041,
          .held_out_corner_p95 = 0.009,
          .held_out_plane = -1};
}

TEST(SessionFiles, SayWhichCalibrationWasUsedAlsoAfterAPowerCut) {
  TemporaryFolder folder;
  SessionInfo info = info_at(kUtc);
  info.calibration = calibration();
  const json said{{"file", "/var/lib/boothd/calibration.toml"},
                  {"utc", "2026-11-28T09:00:00Z"},
                  {"checksum", "crc64:0f1e2d3c4b5a6978"},
                  {"held_out", {{"corner", 0.0041}, {"corner_p95", 0.009}, {"plane", nullptr}}}};
  const auto cut = create_session_folder(folder.path, info), whole = create_session_folder(folder.path / "whole", info);
  EXPECT_EQ(json::parse(read_text(cut / "session.json"))["calibration"], said) << "from the beginning";
  EXPECT_EQ(close_interrupted_sessions(folder.path, models()).size(), 1u);
  EXPECT_EQ(json::parse(read_text(cut / "session.json"))["calibration"], said);
  info.result = "complete";
  info.calibration.checksum.clear();
  finish_session(whole, info, frames(3), models(), nullptr);
  EXPECT_EQ(json::parse(read_text(whole / "session.json"))["calibration"]["checksum"], json()) << "of a file that somebody has edited";
}

TEST(SessionFiles, WithoutACalibrationThatIsSaidToo) {
  using Source = CalibrationUsed::Source;
  for (const auto& [source, said] : {std::pair{Source::layout, json("layout")}, std::pair{Source::unknown, json()}}) {
    TemporaryFolder folder;
    SessionInfo info = info_at(kUtc);
    info.calibration.source = source;
    const auto session = create_session_folder(folder.path, info);
    EXPECT_EQ(close_interrupted_sessions(folder.path, models()).size(), 1u);
    const json j = json::parse(read_text(session / "session.json"));
    ASSERT_TRUE(j.contains("calibration"));
    EXPECT_EQ(j["calibration"], said);
  }
}

TEST(SessionFiles, WhatAnOlderBoothdOrADiskSaidOfTheCalibrationStopsNothing) {
  for (const char* key : {"", R"(,"calibration":null)", R"(,"calibration":7)", R"(,"calibration":"plan")", R"(,"calibration":{})",
                          R"(,"calibration":{"file":3})", R"(,"calibration":[{"file":"x"}])"}) {
    TemporaryFolder folder;
    const std::string name = "20260101T000000Z-00ff/session.json";
    folder.write(name, std::string(R"({"result":"running","booth":"b")") + key + "}");
    EXPECT_EQ(close_interrupted_sessions(folder.path, models()).size(), 1u) << key;
    const json j = json::parse(read_text(folder.path / name));
    EXPECT_EQ(j["result"], "interrupted") << key;
    EXPECT_EQ(j["booth"], "b") << key;
    EXPECT_EQ(j["calibration"], json()) << key;
  }
  TemporaryFolder folder;
  const auto file = folder.write("20260101T000000Z-00ff/session.json", R"({"result":"running","calibration":{"file":"x","utc":1,"held_out":{"corner":"y"}}})");
  EXPECT_EQ(close_interrupted_sessions(folder.path, models()).size(), 1u);
  const json j = json::parse(read_text(file))["calibration"];
  EXPECT_EQ(j["file"], "x");
  EXPECT_EQ(j["utc"], json());
  EXPECT_EQ(j["held_out"]["corner"], json());
}

TEST(SessionFiles, AHostileLogIsNoCrash) {
  TemporaryFolder folder;
  const auto session = create_session_folder(folder.path, info_at(kUtc));
  folder.write((session.filename() / kFrameLogName).string(), std::string(100000, 'x'));
  folder.write("20250101T000000Z-0000/session.json", "[[[[");
  const auto said = close_interrupted_sessions(folder.path, models());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("is no log of boothd"));
  EXPECT_EQ(json::parse(read_text(session / "session.json"))["result"], "interrupted");
}

TEST(SessionFiles, AnEmptySessionIsComplete) {
  TemporaryFolder folder;
  SessionInfo info = info_at(kUtc);
  const auto session = create_session_folder(folder.path, info);
  info.result = "complete";
  finish_session(session, info, {}, models(), nullptr);
  const json j = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(j["frames"], 0);
  EXPECT_FALSE(j.contains("truth"));
  EXPECT_FALSE(std::filesystem::exists(session / "body.ply"));
}

TEST(SessionFiles, AFullRingCountsWhatItLoses) {
  TemporaryFolder folder;
  const auto session = create_session_folder(folder.path, info_at(kUtc));
  SessionLog log;
  log.open(session);
  for (std::uint64_t k = 0; k < 5000; ++k) log.append(frame_at(0));
  log.close();
  EXPECT_GT(log.lost(), 0u);
  EXPECT_LT(log.lost(), 5000u);
}

TEST(SessionFiles, RetentionDeletesTheOldestFirst) {
  TemporaryFolder folder;
  const auto make = [&](const std::string& name, const char* result) {
    folder.write(name + "/session.json", json{{"result", result}}.dump());
    folder.write(name + "/skeleton.csv", std::string(10000, 'x'));
  };
  make("20260101T000000Z-0001", "complete");
  make("20260102T000000Z-0002", "running");
  make("20260103T000000Z-0003", "complete");
  make("20260104T000000Z-0004", "complete");
  folder.write("not-a-session/file", "keep");
  EXPECT_TRUE(prune_sessions(folder.path, 0, 0, kUtc).empty()) << "no limits";
  const auto by_size = prune_sessions(folder.path, 31000, 0, kUtc + 4 * 86'400'000'000'000);
  ASSERT_EQ(by_size.size(), 1u);
  EXPECT_THAT(by_size[0], HasSubstr("20260101T000000Z-0001 was deleted"));
  const auto by_age = prune_sessions(folder.path, 0, 2, kUtc + 5 * 86'400'000'000'000);  // on 6 January: older than the 4th
  ASSERT_EQ(by_age.size(), 2u);
  EXPECT_THAT(by_age[1], HasSubstr("20260103T000000Z-0003"));
  EXPECT_FALSE(std::filesystem::exists(folder.path / "20260102T000000Z-0002")) << "of a boothd that is dead: one that nobody could close grows old, too";
  EXPECT_TRUE(std::filesystem::exists(folder.path / "20260104T000000Z-0004"));
  EXPECT_TRUE(std::filesystem::exists(folder.path / "not-a-session/file"));
}

TEST(SessionFiles, OneInWorkStaysWhateverTheClockSays) {
  TemporaryFolder folder;
  const auto session = create_session_folder(folder.path, info_at(kUtc));
  constexpr std::int64_t later = 35 * 86'400'000'000'000;
  EXPECT_TRUE(prune_sessions(folder.path, 1, 30, kUtc + later).empty());
  EXPECT_TRUE(std::filesystem::exists(session));
  finish_session(session, info_at(kUtc), frames(3), models(), nullptr);
  EXPECT_EQ(prune_sessions(folder.path, 0, 30, kUtc + later).size(), 1u);
}

TEST(SessionFiles, WhatIsDatedAheadAgesFromWhenItWasSeen) {
  TemporaryFolder folder;
  constexpr std::int64_t day = 86'400'000'000'000;
  const auto make = [&](const std::string& name) { folder.write(name + "/session.json", json{{"result", "complete"}}.dump() + std::string(5000, ' ')); };
  make("20360101T000000Z-0001");  // the clock was ten years ahead
  make("20260101T120000Z-0002");
  EXPECT_TRUE(prune_sessions(folder.path, 0, 30, kUtc + day).empty());
  EXPECT_TRUE(prune_sessions(folder.path, 0, 30, kUtc + 29 * day).empty());
  // By size the one that was first seen on the second of January goes after the one that was made on the first.
  make("20260130T120000Z-0003");
  EXPECT_THAT(prune_sessions(folder.path, 11000, 0, kUtc + 30 * day).at(0), HasSubstr("20260101T120000Z-0002"));
  EXPECT_THAT(prune_sessions(folder.path, 0, 30, kUtc + 32 * day).at(0), HasSubstr("20360101T000000Z-0001 was deleted"));
  for (const char* damaged : {"", "x", "20990101T000000Z", "2026-01-01T00:00:0Z"}) {
    make("20360101T000000Z-0001");
    folder.write("20360101T000000Z-0001/.ahead", damaged);
    EXPECT_TRUE(prune_sessions(folder.path, 0, 30, kUtc + 33 * day).empty()) << damaged;
    EXPECT_THAT(prune_sessions(folder.path, 0, 30, kUtc + 64 * day).at(0), HasSubstr("was deleted")) << damaged;
  }
}

TEST(SessionFiles, ALogWhoseHeadIsRottenIsReadAllTheSame) {
  for (const std::size_t at : {0u, 7u, 12u, 13u}) {  // of its magic, of the size of its records
    TemporaryFolder folder;
    const auto session = interrupted(folder.path, frames(30));
    std::fstream log(session / kFrameLogName, std::ios::in | std::ios::out | std::ios::binary);
    log.seekg(static_cast<std::streamoff>(at));
    const int byte = log.get();
    log.seekp(static_cast<std::streamoff>(at));
    log.put(static_cast<char>(byte ^ 0x20));
    log.close();
    const auto said = close_interrupted_sessions(folder.path, models());
    ASSERT_EQ(said.size(), 1u);
    EXPECT_THAT(said[0], HasSubstr("30 frames of it were saved")) << at;
    EXPECT_THAT(said[0], HasSubstr("its head is damaged")) << at;
    EXPECT_TRUE(std::filesystem::exists(session / kDamagedLogName)) << at;
  }
}

TEST(SessionFiles, ALogOfWhichNothingCanBeMadeIsKept) {
  TemporaryFolder folder;
  const auto session = create_session_folder(folder.path, info_at(kUtc));
  std::ofstream(session / kFrameLogName) << std::string(100'000, 'x');
  const auto said = close_interrupted_sessions(folder.path, models());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("it stays as frames.damaged"));
  EXPECT_EQ(std::filesystem::file_size(session / kDamagedLogName), 100'000u);
  EXPECT_EQ(read_session(session).result, "interrupted");
  EXPECT_TRUE(close_interrupted_sessions(folder.path, models()).empty()) << "once is enough";
}

TEST(SessionFiles, AFileThatCannotBeReadStopsNoStart) {
  TemporaryFolder folder;
  const auto session = interrupted(folder.path, frames(5));
  std::filesystem::remove(session / "session.json");
  std::filesystem::create_directory(session / "session.json");  // reading it fails as a rotten sector does
  const auto said = close_interrupted_sessions(folder.path, models());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("cannot be closed"));
  EXPECT_TRUE(std::filesystem::exists(session / kFrameLogName)) << "it may be read another time";
}

TEST(SessionFiles, ABodyOfAnotherModelCostsNoSkeleton) {
  TemporaryFolder folder;
  auto recorded = frames(5);
  for (auto& f : recorded) {
    f.shape_count = kRecordShape;
    f.beta[kRecordShape - 1] = 3;
  }
  const auto session = interrupted(folder.path, recorded);
  EXPECT_THAT(close_interrupted_sessions(folder.path, models()).at(0), HasSubstr("5 frames of it were saved"));
  EXPECT_TRUE(std::filesystem::exists(session / "skeleton.csv"));
  EXPECT_FALSE(std::filesystem::exists(session / "body.ply"));
  std::ifstream in(session / "session.json");
  EXPECT_THAT(json::parse(in).at("body_problem").get<std::string>(), HasSubstr("64 coefficients"));
  const ShiftedTruth truth;
  EXPECT_EQ(truth_error(recorded, models(), truth).surface_frames, 0u);
}

TEST(SessionFiles, DeepNestingOverflowsNoStack) {
  TemporaryFolder folder;
  const auto session = interrupted(folder.path, frames(5));
  const std::string deep = R"({"result":"complete","format":)" + std::string(200'000, '[') + std::string(200'000, ']') + "}";
  folder.write(session.filename().string() + "/session.json", deep);
  EXPECT_TRUE(close_interrupted_sessions(folder.path, models()).empty()) << "it says that it is complete";
  EXPECT_THROW(read_session(session), std::runtime_error);
}

TEST(SessionFiles, AClockThatLeaptDeletesNothingForADay) {
  TemporaryFolder folder;
  constexpr std::int64_t day = 86'400'000'000'000;
  const auto make = [&](const std::string& name) { folder.write(name + "/session.json", json{{"result", "complete"}}.dump()); };
  const auto there = [&](const char* name) { return std::filesystem::exists(folder.path / name); };
  make("20260101T000000Z-0001");
  EXPECT_TRUE(prune_sessions(folder.path, 0, 30, kUtc).empty());
  const std::int64_t leapt = kUtc + 3650 * day;
  for (const std::int64_t later : {std::int64_t{0}, day / 2, day}) {
    const auto said = prune_sessions(folder.path, 0, 30, leapt + later);
    ASSERT_EQ(said.size(), 1u);
    EXPECT_THAT(said[0], HasSubstr("the clock leapt"));
  }
  // Another leap begins the day anew; going back makes nothing old, and is believed.
  EXPECT_EQ(prune_sessions(folder.path, 0, 30, leapt + 3650 * day).size(), 1u);
  EXPECT_TRUE(prune_sessions(folder.path, 0, 30, kUtc + day).empty());
  EXPECT_EQ(prune_sessions(folder.path, 0, 30, leapt).size(), 1u);
  EXPECT_TRUE(there("20260101T000000Z-0001"));
  // A clock that goes on from there is right, or nobody cares.
  EXPECT_THAT(prune_sessions(folder.path, 0, 30, leapt + day + 1).at(0), HasSubstr("was deleted"));
  EXPECT_FALSE(there("20260101T000000Z-0001"));
  make("20260102T000000Z-0002");
  EXPECT_THAT(prune_sessions(folder.path, 0, 30, leapt + 20 * day).at(0), HasSubstr("was deleted")) << "a booth that was off for weeks";
  for (const char* damaged : {"", "x", "99999999999999999999 1", "-5 -5", "5", "9223372036854775807 9223372036854775807"}) {
    folder.write(".clock", damaged);
    make("20260103T000000Z-0003");
    EXPECT_THAT(prune_sessions(folder.path, 0, 30, leapt + 21 * day).at(0), HasSubstr("was deleted")) << damaged;
  }
}

TEST(SessionFiles, ADamagedSessionFileCostsNoFrames) {
  for (const char* damaged : {"", "{", "{\"resalt\": \"running\"}", "{\"result\": \"runnin\"}", "{\"result\": 5}", "[]"}) {
    TemporaryFolder folder;
    const auto session = create_session_folder(folder.path, info_at(kUtc));
    SessionLog log;
    log.open(session);
    for (std::uint64_t k = 0; k < 40; ++k) log.append(frame_at(k));
    log.close();
    std::ofstream(session / "session.json") << damaged;
    EXPECT_EQ(close_interrupted_sessions(folder.path, {}).size(), 1u) << damaged;
    const json j = json::parse(read_text(session / "session.json"));
    EXPECT_EQ(j["result"], "interrupted") << damaged;
    EXPECT_EQ(j["frames"], 40) << damaged;
  }
}

TEST(SessionFiles, SaysWhyAFolderCannotBeMade) {
  TemporaryFolder folder;
  const auto file = folder.write("in-the-way", "");
  try {
    create_session_folder(file, info_at(kUtc));
    FAIL() << "a folder inside a file";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("in-the-way"));
    EXPECT_THAT(e.what(), HasSubstr("session.directory"));
  }
}

}  // namespace
}  // namespace booth::daemon
