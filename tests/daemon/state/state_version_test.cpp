// An update can be taken back: each file that outlives a boothd is read by its neighbours, one version forward and one back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/config/load.hpp"
#include "daemon/record/session_info.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/record/session_reader.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "hal/file_version.hpp"
#include "tests/daemon/record/session_samples.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/complaint.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tests::complaint;
using tests::read_text;
using tests::TemporaryFolder;

/// What version 1 wrote, never to be changed. With BOOTHD_MAKE_STATE=1 what this version writes is laid down as a folder beside it, once for each version.
const fs::path kFixtures = fs::path(BOOTH_SOURCE_DIR) / "tests/daemon/state";
constexpr std::uint64_t kFrames = 3;

std::string with(std::string text, const std::string& old, const std::string& now) {
  const auto at = text.find(old);
  if (at == std::string::npos) throw std::runtime_error("the fixture has no '" + old + "'");
  return text.replace(at, old.size(), now);
}

void make(const fs::path& folder) {
  const fs::path session = create_session_folder(folder, tests::sample_info());
  SessionLog log;
  log.open(session);
  for (const FrameRecord& f : tests::sample_frames(kFrames)) log.append(f);
  log.close();
  fs::copy_file(session / kFrameLogName, folder / "frames.log");
  SessionInfo info = tests::sample_info();
  info.result = "complete";
  finish_session(session, info, tests::sample_frames(kFrames), tests::sample_models(), nullptr);
  fs::create_directories(folder / "session");
  for (const char* name : {"session.json", "skeleton.csv"}) fs::copy_file(session / name, folder / "session" / name);
  fs::remove_all(session);
  hal::CameraDescription camera;
  camera.name = "front", camera.serial = "501000000001", camera.nominal_rate = 30, camera.depth_scale = 0.001;
  camera.intrinsics = {.width = 512, .height = 424, .fx = 365, .fy = 365, .cx = 256, .cy = 212, .distortion = {}};
  drivers::write_calibration(folder / "calibration.toml", {camera});
  std::ofstream(folder / "boothd.toml") << "version = 1\n\n[booth]\nid = \"seventeen\"\n";
}

TEST(State, CanBeLaidDownForLaterVersions) {
  if (const char* asked = std::getenv("BOOTHD_MAKE_STATE"); !asked || !*asked) GTEST_SKIP() << "skipped: BOOTHD_MAKE_STATE is not set";
  const fs::path folder = kFixtures / ("version-" + std::to_string(kSessionFormat));
  ASSERT_FALSE(fs::exists(folder)) << "what a version wrote is not written again";
  make(folder);
}

std::string fixture(const std::string& name) { return read_text(kFixtures / "version-1" / name); }

TEST(State, TheRuleIsOneForwardAndOneBack) {
  using enum hal::FileVersion;
  EXPECT_EQ(hal::judge_file_version(1, 1), readable);
  EXPECT_EQ(hal::judge_file_version(2, 1), newer);
  EXPECT_EQ(hal::judge_file_version(3, 1), unreadable);
  EXPECT_EQ(hal::judge_file_version(0, 1), unreadable);
  EXPECT_EQ(hal::judge_file_version(-1, 1), unreadable);
  EXPECT_EQ(hal::judge_file_version(1, 2), readable) << "of the version before";
  EXPECT_EQ(hal::judge_file_version(1, 3), unreadable) << "of the one before that";
}

// Configuration

Config config_from(const std::string& text, std::vector<std::string>& warnings) {
  const TemporaryFolder folder;
  return load_config({.file = folder.write("boothd.toml", text), .assignments = {}}, &warnings);
}

TEST(State, ConfigurationOfVersion1IsRead) {
  std::vector<std::string> warnings{"none"};
  EXPECT_EQ(config_from(fixture("boothd.toml"), warnings).booth.id, "seventeen");
  EXPECT_THAT(warnings, IsEmpty());
  EXPECT_EQ(config_from("[booth]\nid = \"old\"\n", warnings).booth.id, "old") << "before there was a version";
}

TEST(State, OfTheNextConfigurationWhatIsNotKnownIsPassedOverWithAWarning) {
  std::vector<std::string> warnings;
  const std::string next = with(fixture("boothd.toml"), "version = 1", "version = 2") + "hue = 3\n\n[weather]\nforecast = true\n";
  EXPECT_EQ(config_from(next, warnings).booth.id, "seventeen");
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("boothd.toml:1: is of version 2"), HasSubstr("boothd.toml:5: booth.hue: is not a key of this version"),
                                    HasSubstr("weather: is not a key of this version")));
}

TEST(State, InAFileOfThisVersionAMistakeStaysAMistake) {
  std::vector<std::string> warnings;
  EXPECT_THAT(complaint([&] { config_from(fixture("boothd.toml") + "hue = 3\n", warnings); }), HasSubstr("booth.hue: is not a key of boothd"));
  EXPECT_THAT(complaint([&] { config_from("hue = 3\n", warnings); }), HasSubstr("hue: is not a key of boothd"));
  // A drop-in of the next version does not excuse the file before or after it.
  const TemporaryFolder folder;
  folder.write("boothd.toml.d/1.toml", "version = 2\n[weather]\nforecast = true\n");
  folder.write("boothd.toml.d/2.toml", "[weather]\nforecast = true\n");
  const std::string said = complaint([&] { load_config({.file = folder.write("boothd.toml", ""), .assignments = {}}, &warnings); });
  EXPECT_THAT(said, HasSubstr("2.toml:1: weather: is not a key of boothd"));
  EXPECT_THAT(said, ::testing::Not(HasSubstr("1.toml")));
}

TEST(State, AValueThatIsNotKnownIsAMistakeInEveryVersion) {
  std::vector<std::string> warnings;
  EXPECT_THAT(complaint([&] { config_from("version = 2\n[dds]\nsecurity = \"strict\"\n", warnings); }), HasSubstr("\"strict\" is not known"));
}

TEST(State, AConfigurationTwoVersionsAwayIsRefused) {
  std::vector<std::string> warnings;
  EXPECT_THAT(complaint([&] { config_from("version = 3\n", warnings); }), HasSubstr("boothd.toml:1: version: is of version 3, this program writes 1"));
  EXPECT_THAT(complaint([&] { config_from("version = 0\n", warnings); }), HasSubstr("is of version 0"));
  EXPECT_THAT(complaint([&] { config_from("version = \"1\"\n", warnings); }), HasSubstr("version: must be a whole number"));
}

// Calibration

std::vector<hal::CameraDescription> calibration_from(const std::string& text, std::vector<std::string>& warnings) {
  const TemporaryFolder folder;
  drivers::CalibrationNotes notes;
  auto cameras = drivers::read_calibration(folder.write("calibration.toml", text), &notes);
  warnings = notes.newer;
  return cameras;
}

TEST(State, CalibrationOfVersion1IsRead) {
  std::vector<std::string> warnings;
  const auto cameras = calibration_from(fixture("calibration.toml"), warnings);
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_EQ(cameras[0].serial, "501000000001");
  EXPECT_EQ(cameras[0].intrinsics.fx, 365);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(State, OfTheNextCalibrationWhatIsNotKnownIsPassedOverWithAWarning) {
  std::vector<std::string> warnings;
  const std::string next = with(fixture("calibration.toml"), "version = 1", "version = 2\nclimate = 3") + "\n[lens]\nk4 = 0.1\n";
  EXPECT_EQ(calibration_from(with(next, "rate = ", "temperature = 30.5\nrate = "), warnings).size(), 1u);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("calibration.toml: is of version 2, this program writes 1; what it does not know is passed over")));
}

TEST(State, ACalibrationTwoVersionsAwayIsRefused) {
  std::vector<std::string> warnings;
  EXPECT_THAT(complaint([&] { calibration_from(with(fixture("calibration.toml"), "version = 1", "version = 3"), warnings); }),
              HasSubstr("line 2: is of version 3"));
  EXPECT_THAT(complaint([&] { calibration_from(with(fixture("calibration.toml"), "version = 1", "version = 1.5"), warnings); }),
              HasSubstr("version must be a whole number"));
}

TEST(State, ACalibrationWhoseReadingFailsIsNamed) {
  // A disk that fails says the same as this file of the kernel.
  EXPECT_THAT(complaint([] { drivers::read_calibration("/proc/self/mem"); }), HasSubstr("/proc/self/mem: cannot be read to its end"));
}

// Sessions

void lay_out(const TemporaryFolder& folder, const std::string& json, const std::string& csv) {
  folder.write("session.json", json);
  folder.write("skeleton.csv", csv);
}

TEST(State, ASessionOfVersion1IsRead) {
  const SessionContents session = read_session(kFixtures / "version-1/session");
  EXPECT_EQ(session.result, "complete");
  EXPECT_EQ(session.warning, "");
  ASSERT_EQ(session.frames.size(), kFrames);
  EXPECT_NEAR(session.frames[2].q[1], tests::sample_frames(kFrames)[2].q[1], 1e-6);
}

TEST(State, ASessionWithoutAFormatIsOfTheFirst) {
  const TemporaryFolder folder;
  auto j = nlohmann::json::parse(fixture("session/session.json"));
  ASSERT_EQ(j.erase("format"), 1u);
  lay_out(folder, j.dump(), fixture("session/skeleton.csv"));
  EXPECT_EQ(read_session(folder.path).frames.size(), kFrames);
}

TEST(State, OfTheNextSessionWhatIsNotKnownIsPassedOverWithAWarning) {
  const TemporaryFolder folder;
  auto j = nlohmann::json::parse(fixture("session/session.json"));
  j["format"] = kSessionFormat + 1;
  j["mood"] = {{"is", "good"}};
  std::string csv;
  std::istringstream lines(fixture("session/skeleton.csv"));
  for (std::string line; std::getline(lines, line);) csv += line + (csv.empty() ? ",mood,grip_n\n" : ",0.5,7\n");
  lay_out(folder, j.dump(), csv);
  const SessionContents session = read_session(folder.path);
  EXPECT_EQ(session.frames.size(), kFrames);
  EXPECT_THAT(session.warning, HasSubstr("session.json: is of version 2, this program writes 1; what it does not know is passed over"));
}

TEST(State, ASessionTwoVersionsAwayIsRefused) {
  const TemporaryFolder folder;
  auto j = nlohmann::json::parse(fixture("session/session.json"));
  j["format"] = kSessionFormat + 2;
  lay_out(folder, j.dump(), fixture("session/skeleton.csv"));
  EXPECT_THAT(complaint([&] { read_session(folder.path); }), HasSubstr("session.json: is of version 3"));
}

// The log of a session that was cut off, which the boothd after an update, or after the way back, finds at its start

constexpr std::size_t kHead = 16, kVersionAt = 8, kBytesAt = 12;

/// The fixture as a later version writes it: its number, and `more` bytes after each record.
std::string log_of(std::uint32_t version, std::uint32_t more) {
  const std::string first = fixture("frames.log");
  std::uint32_t bytes = 0;
  std::memcpy(&bytes, first.data() + kBytesAt, sizeof bytes);
  std::string out = first.substr(0, kHead);
  for (std::size_t at = kHead; at + bytes <= first.size(); at += bytes) out += first.substr(at, bytes) + std::string(more, '\x5a');
  bytes += more;
  std::memcpy(out.data() + kVersionAt, &version, sizeof version);
  std::memcpy(out.data() + kBytesAt, &bytes, sizeof bytes);
  return out;
}

std::vector<FrameRecord> frames_from(const std::string& log) {
  const TemporaryFolder folder;
  folder.write(kFrameLogName, log);
  return read_session_log(folder.path);
}

void expect_samples(const std::vector<FrameRecord>& frames) {
  const auto samples = tests::sample_frames(kFrames);
  ASSERT_EQ(frames.size(), kFrames);
  for (std::size_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(frames[i].sequence, samples[i].sequence);
    EXPECT_EQ(frames[i].captured_utc_ns, samples[i].captured_utc_ns);
    for (std::size_t d = 0; d < kRecordDofs; ++d) EXPECT_NEAR(frames[i].q[d], samples[i].q[d], 1e-12);
    EXPECT_EQ(frames[i].shape_count, samples[i].shape_count);
    EXPECT_EQ(frames[i].person, samples[i].person);
  }
}

TEST(State, ALogOfVersion1IsRead) { expect_samples(frames_from(fixture("frames.log"))); }

TEST(State, OfTheNextLogWhatWasAppendedIsPassedOver) {
  expect_samples(frames_from(log_of(kFrameLogVersion + 1, 40)));
  expect_samples(frames_from(log_of(kFrameLogVersion + 1, 0)));
}

TEST(State, ALogWhoseHeadLiesIsRefused) {
  EXPECT_THAT(complaint([] { frames_from(log_of(kFrameLogVersion, 40)); }), HasSubstr("which no version writes"));
  for (const std::uint32_t bytes : {0u, 100u, 0x7fffffffu}) {
    std::string log = log_of(kFrameLogVersion + 1, 0);
    std::memcpy(log.data() + kBytesAt, &bytes, sizeof bytes);
    EXPECT_THAT(complaint([&] { frames_from(log); }), HasSubstr("which no version writes")) << bytes;
  }
  EXPECT_THAT(complaint([] { frames_from("boothlog"); }), HasSubstr("is no log of boothd"));
}

TEST(State, ALogTwoVersionsAwayWaitsForWhoWroteIt) {
  const TemporaryFolder folder;
  const fs::path session = create_session_folder(folder.path, tests::sample_info());
  const std::string log = log_of(kFrameLogVersion + 2, 8);
  folder.write(session.filename() / kFrameLogName, log);
  EXPECT_THAT(close_interrupted_sessions(folder.path, tests::sample_models()), ElementsAre(HasSubstr("is left as it is: ")));
  EXPECT_EQ(read_text(session / kFrameLogName), log) << "it is not lost";
}

TEST(State, AnInterruptedSessionOfTheNextVersionIsClosedWithItsFrames) {
  const TemporaryFolder folder;
  const fs::path session = create_session_folder(folder.path, tests::sample_info());
  folder.write(session.filename() / kFrameLogName, log_of(kFrameLogVersion + 1, 24));
  EXPECT_THAT(close_interrupted_sessions(folder.path, tests::sample_models()), ElementsAre(HasSubstr("3 frames of it were saved")));
  EXPECT_EQ(read_session(session).result, "interrupted");
}

}  // namespace
}  // namespace booth::daemon
