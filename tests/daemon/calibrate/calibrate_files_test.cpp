// The board's page, the folder of views, the stored calibration and the flow of a capture.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <thread>

#include "daemon/calibrate/board_pdf.hpp"
#include "daemon/calibrate/calibration_store.hpp"
#include "daemon/calibrate/capture_flow.hpp"
#include "daemon/calibrate/view_folder.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "tests/support/complaint.hpp"

namespace booth::tests {
namespace {

namespace fs = std::filesystem;
using namespace daemon;
using fit::calibrate::Board;
using fit::calibrate::Rigid;

/// A folder of its own, gone afterwards.
struct Scratch {
  fs::path path;
  Scratch() {
    std::string name = (fs::temp_directory_path() / "boothd-calibrate-XXXXXX").string();
    path = ::mkdtemp(name.data());
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

TEST(BoardPdf, EachPaperHasItsSizeAndItsBlackSquaresTrueToScale) {
  for (const auto& paper : fit::calibrate::papers()) {
    const std::string pdf = board_pdf(paper);
    EXPECT_THAT(pdf, testing::StartsWith("%PDF-1.4\n"));
    EXPECT_THAT(pdf, testing::HasSubstr("/PrintScaling /None"));
    std::smatch box;
    ASSERT_TRUE(std::regex_search(pdf, box, std::regex(R"(/MediaBox \[0 0 ([0-9.]+) ([0-9.]+)\])")));
    EXPECT_NEAR(std::stod(box[1]) * 25.4 / 72, paper.width, 0.01);
    EXPECT_NEAR(std::stod(box[2]) * 25.4 / 72, paper.height, 0.01);
    // Rectangles as large as a square, where black ones belong.
    const std::regex rectangle(R"(([0-9.]+) ([0-9.]+) ([0-9.]+) ([0-9.]+) re f)");
    int squares = 0;
    for (auto it = std::sregex_iterator(pdf.begin(), pdf.end(), rectangle); it != std::sregex_iterator(); ++it) {
      const double x = std::stod((*it)[1]) * 25.4 / 72, y = std::stod((*it)[2]) * 25.4 / 72, w = std::stod((*it)[3]) * 25.4 / 72;
      if (std::abs(w - paper.square) > 0.01) continue;
      ++squares;
      const double column = (x - (paper.width - Board::kColumns * paper.square) / 2) / paper.square;
      const double row = Board::kRows - 1 - (y - (paper.height - Board::kRows * paper.square) / 2) / paper.square;
      EXPECT_NEAR(column, std::round(column), 1e-3);
      EXPECT_TRUE(Board::black(static_cast<int>(std::round(row)), static_cast<int>(std::round(column))));
    }
    EXPECT_EQ(squares, 18);
    // The table of a PDF points at its objects.
    const auto table = pdf.rfind("startxref\n");
    EXPECT_EQ(pdf.compare(std::stoul(pdf.substr(table + 10)), 4, "xref"), 0);
  }
}

CalibrationRecord record() {
  CalibrationRecord r;
  r.cameras = simulated_cameras(1).planned;
  r.utc = "2026-11-28T09:00:00Z", r.by = "Ana \"the\" installer", r.software = "boothd test", r.square = 0.108, r.views = 25;
  r.result.errors.camera.resize(4);
  for (std::size_t i = 0; i < 4; ++i) {
    fit::calibrate::CalibratedCamera c;
    c.booth_from_camera = Rigid{fit::calibrate::rotation_by({0.1 * static_cast<double>(i), 0.3, -0.2}), {1.0 / 3, 2, 1.6}};
    c.depth = {0.00123, -0.0045};
    r.result.cameras.push_back(c);
  }
  return r;
}

TEST(CalibrationStore, WhatIsStoredIsReadBackToTheBit) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  const CalibrationRecord r = record();
  store_calibration(file, r);
  const StoredCalibration back = load_calibration(file);
  ASSERT_EQ(back.cameras.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(back.cameras[i].serial, r.cameras[i].serial);
    EXPECT_EQ(back.calibrated[i].booth_from_camera.translation, r.result.cameras[i].booth_from_camera.translation);
    EXPECT_EQ(back.calibrated[i].depth.gain, 0.00123);
    EXPECT_EQ(back.calibrated[i].depth.offset, -0.0045);
  }
  EXPECT_EQ(back.by, r.by);
  EXPECT_EQ(back.square, 0.108);
}

/// What a session would say of the file.
CalibrationUsed used(const fs::path& file, bool written = true) {
  drivers::CalibrationNotes notes;
  (void)drivers::read_calibration(file, &notes);
  return calibration_used(file, notes, written);
}

TEST(CalibrationUsed, IsToldAsItIsStored) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  CalibrationRecord r = record();
  r.result.errors.corner_mm = 4.25, r.result.errors.corner_p95_mm = 9.5, r.result.errors.plane_mm = 1.5;
  store_calibration(file, r);
  fs::last_write_time(file, fs::file_time_type::clock::now() + std::chrono::hours(24 * 365));  // a file that was copied is no newer calibration
  const CalibrationUsed back = used(file);
  EXPECT_EQ(back.source, CalibrationUsed::Source::file);
  EXPECT_EQ(back.file, file.string());
  EXPECT_EQ(back.utc, "2026-11-28T09:00:00Z");
  EXPECT_EQ(calibrated_utc_ns(back), 1'795'856'400'000'000'000);
  EXPECT_THAT(back.checksum, testing::MatchesRegex("crc64:[0-9a-f]{16}"));
  EXPECT_THAT(read_file_bytes(file, 1u << 20), testing::HasSubstr("checksum = \"" + back.checksum + "\""));
  EXPECT_DOUBLE_EQ(back.held_out_corner, 0.00425);
  EXPECT_DOUBLE_EQ(back.held_out_corner_p95, 0.0095);
  EXPECT_DOUBLE_EQ(back.held_out_plane, 0.0015);
}

TEST(CalibrationUsed, OneThatDoesNotSayWhenIsAsOldAsItsFile) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  for (const char* says :
       {"", "[calibration]\nutc = 7\nheld_out = 3\n", "[calibration]\nutc = \"yesterday\"\n[calibration.held_out]\ncorner_mm = -1.0\nplane_mm = nan\n",
        "[calibration]\nutc = \"9999-01-01T00:00:00Z\"\n[calibration.held_out]\ncorner_mm = inf\n"}) {
    write_file_atomically(file, "version = 1\n" + std::string(says) + camera_table(record().cameras[0]));
    const timespec then[2] = {{1'790'000'000, 0}, {1'790'000'000, 0}};
    ASSERT_EQ(::utimensat(AT_FDCWD, file.c_str(), then, 0), 0);
    const CalibrationUsed there = used(file);
    EXPECT_EQ(calibrated_utc_ns(there), 1'790'000'000'000'000'000) << says;
    EXPECT_EQ(there.utc, "2026-09-21T14:13:20Z") << says;
    EXPECT_EQ(there.checksum, "") << says;
    EXPECT_LT(there.held_out_corner, 0) << says;
    EXPECT_LT(there.held_out_plane, 0) << says;
    const CalibrationUsed copied = used(file, false);
    EXPECT_EQ(copied.utc, "") << says;
    EXPECT_EQ(calibrated_utc_ns(copied), 0) << says;
  }
}

#ifdef BOOTHD_EMULATOR
TEST(CalibrationUsed, EmulatedSensorsHaveTheStoredOneAsRealOnesDo) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  Config config;
  config.cameras.driver = "kinect2-emulated";
  config.cameras.emulated.rate = 1;
  config.cameras.kinect2.calibration = file.string();
  using Source = CalibrationUsed::Source;
  EXPECT_EQ(open_source(config).calibration.source, Source::layout) << "there is none yet";

  CalibrationRecord theirs = record();
  for (std::size_t i = 0; i < 4; ++i) theirs.cameras[i].serial = "00000000000" + std::to_string(4 - i);  // in another order
  theirs.late = {0.001, 0, 0, 0};
  store_calibration(file, theirs);
  const DepthSource source = open_source(config);
  EXPECT_EQ(source.calibration.source, Source::file);
  EXPECT_EQ(source.calibration.file, file.string());
  EXPECT_EQ(source.calibration.utc, "2026-11-28T09:00:00Z");
  ASSERT_EQ(source.cameras.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const hal::CameraDescription& camera = source.cameras[i]->description();
    EXPECT_EQ(camera.serial, "00000000000" + std::to_string(i + 1));
    EXPECT_EQ(camera.name, theirs.cameras[3 - i].name);
    EXPECT_EQ(camera.depth_gain, 0.00123);
    EXPECT_NEAR(camera.camera_to_world.translation[0], 1.0 / 3, 1e-12);
  }

  theirs.cameras[2].serial = "018436651247";
  store_calibration(file, theirs);
  const DepthSource other = open_source(config);
  EXPECT_EQ(other.calibration.source, Source::layout) << "it is of other sensors";
  EXPECT_EQ(other.cameras[0]->description().depth_gain, 0);
  write_file_atomically(file, "nonsense");
  EXPECT_THROW(open_source(config), std::runtime_error) << "as with real ones: nobody guesses";
}
#endif

TEST(CalibrationStore, TheOneBeforeIsKeptAndARefusedOneTouchesNothing) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  CalibrationRecord r = record();
  store_calibration(file, r);
  r.utc = "2026-11-29T10:00:00Z";
  store_calibration(file, r);
  EXPECT_EQ(load_calibration(file).utc, "2026-11-29T10:00:00Z");
  EXPECT_EQ(load_calibration(scratch.path / "calibration.before-20261128T090000Z.toml").utc, "2026-11-28T09:00:00Z");
  r.result.refusal = fit::calibrate::Refusal::inaccurate;
  EXPECT_THROW(store_calibration(file, r), std::runtime_error);
  EXPECT_EQ(load_calibration(file).utc, "2026-11-29T10:00:00Z");
  for (int day = 10; day < 28; ++day) {
    r.result.refusal = fit::calibrate::Refusal::none;
    r.utc = "2026-12-" + std::to_string(day) + "T10:00:00Z";
    store_calibration(file, r);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path), fs::directory_iterator()), 11);
}

TEST(CalibrationStore, TwoOfOneTimeAreBothKept) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  CalibrationRecord r = record();
  for (const char* by : {"first", "second", "third"}) r.by = by, store_calibration(file, r);
  EXPECT_NE(read_file_bytes(scratch.path / "calibration.before-20261128T090000Z.toml", 1u << 20).find("first"), std::string::npos);
  EXPECT_NE(read_file_bytes(scratch.path / "calibration.before-20261128T090000Z-02.toml", 1u << 20).find("second"), std::string::npos);
  EXPECT_EQ(restore_calibration(file).filename(), "calibration.before-20261128T090000Z-02.toml") << "the newest of them";
  // What is kept already is not kept twice.
  store_calibration(file, r);
  store_calibration(file, r);
  EXPECT_FALSE(fs::exists(scratch.path / "calibration.before-20261128T090000Z-04.toml"));
}

TEST(CalibrationStore, AFullDiskLeavesTheGoodOneAndNoRubbish) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  store_calibration(file, record());
  const std::string before = read_file_bytes(file, 1u << 20);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // Files may grow to this size only: what a full disk does to a write.
    const rlimit tiny{100, 100};
    ::signal(SIGXFSZ, SIG_IGN);
    ::setrlimit(RLIMIT_FSIZE, &tiny);
    CalibrationRecord next = record();
    next.utc = "2026-11-29T10:00:00Z";
    int status = 0;
    try {
      store_calibration(file, next);
    } catch (const std::runtime_error& e) {
      status = std::string(e.what()).find("nothing was changed") != std::string::npos ? 7 : 8;
    }
    ::_exit(status);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  EXPECT_EQ(read_file_bytes(file, 1u << 20), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path), fs::directory_iterator()), 1) << "no half-written file stays";
}

TEST(CalibrationStore, ADamagedOneIsReplacedByTheNewestThatCanBeRead) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  EXPECT_THROW(restore_calibration(file), std::runtime_error) << "there is none";
  CalibrationRecord r = record();
  for (const char* utc : {"2026-11-28T09:00:00Z", "2026-11-29T09:00:00Z", "2026-11-30T09:00:00Z"}) r.utc = utc, store_calibration(file, r);
  write_file_atomically(file, "half a fi");
  write_file_atomically(scratch.path / "calibration.before-20261129T090000Z.toml", "torn, too");
  EXPECT_EQ(restore_calibration(file).filename(), "calibration.before-20261128T090000Z.toml");
  EXPECT_EQ(load_calibration(file).utc, "2026-11-28T09:00:00Z");
  EXPECT_EQ(read_file_bytes(scratch.path / "calibration.replaced.toml", 1u << 20), "half a fi");
}

TEST(CalibrationStore, TheLastThatWasReplacedIsTheNewestWhateverItsDate) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  CalibrationRecord r = record();
  // The second one was made while the clock stood at its beginning, the first while it was ahead.
  for (const char* utc : {"2036-01-01T09:00:00Z", "2000-01-01T09:00:00Z", "2026-11-30T09:00:00Z"}) {
    r.utc = utc, store_calibration(file, r);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // longer than the file system's clock ticks
  }
  EXPECT_EQ(restore_calibration(file).filename(), "calibration.before-20000101T090000Z.toml");
  for (int day = 10; day < 20; ++day) {  // one more than there is room for with these
    r.utc = "2026-12-" + std::to_string(day) + "T10:00:00Z";
    store_calibration(file, r);
  }
  r.utc = "1999-01-01T09:00:00Z", store_calibration(file, r);
  r.utc = "2026-12-24T09:00:00Z", store_calibration(file, r);
  EXPECT_TRUE(fs::exists(scratch.path / "calibration.before-19990101T090000Z.toml")) << "the one before is kept, whatever its date";
}

TEST(CalibrationStore, AClockThatWentBackLeavesTheOrder) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  CalibrationRecord r = record();
  r.utc = "2026-11-01T09:00:00Z", store_calibration(file, r);
  r.utc = "2026-10-01T09:00:00Z", store_calibration(file, r);
  for (const auto ahead : {std::chrono::seconds(30), std::chrono::seconds(300'000'000)}) {
    // All that is kept is from a time that has yet to come.
    for (const auto& entry : fs::directory_iterator(scratch.path))
      if (entry.path().filename().string().starts_with("calibration.before-")) fs::last_write_time(entry.path(), fs::file_time_type::clock::now() + ahead);
    const std::string month = ahead < std::chrono::hours(1) ? "09" : "08";
    r.utc = "2026-" + month + "-01T09:00:00Z", store_calibration(file, r);
    r.utc = "2026-" + month + "-02T09:00:00Z", store_calibration(file, r);
    EXPECT_EQ(restore_calibration(file).filename(), "calibration.before-2026" + month + "01T090000Z.toml");
  }
}

TEST(CalibrationStore, WhatIsDamagedAndHasNoTimeIsKeptUnderTheTimeOfItsFile) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  store_calibration(file, record());
  std::string text = read_file_bytes(file, 1u << 20);
  text.replace(text.find("2026-11-28T"), 4, "9999");  // it has a time, which is not to be trusted
  int files = 1;
  for (const auto& [damaged, name] : {std::pair{std::string("half a fi"), "20260921T141320Z"}, std::pair{text, "20260921T141320Z-02"}}) {
    write_file_atomically(file, damaged);
    const timespec when[2] = {{1'790'000'000, 0}, {1'790'000'000, 0}};
    ASSERT_EQ(::utimensat(AT_FDCWD, file.c_str(), when, 0), 0);
    store_calibration(file, record());
    EXPECT_EQ(read_file_bytes(scratch.path / (std::string("calibration.before-") + name + ".toml"), 1u << 20), damaged);
    EXPECT_EQ(std::distance(fs::directory_iterator(scratch.path), fs::directory_iterator()), ++files);
  }
}

bool same_numbers(const std::vector<hal::CameraDescription>& a, const std::vector<hal::CameraDescription>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) {
    return x.name == y.name && x.serial == y.serial && x.camera_to_world.rotation == y.camera_to_world.rotation &&
           x.camera_to_world.translation == y.camera_to_world.translation && x.depth_gain == y.depth_gain && x.depth_offset == y.depth_offset &&
           x.depth_scale == y.depth_scale && x.intrinsics.width == y.intrinsics.width && x.intrinsics.height == y.intrinsics.height &&
           x.intrinsics.fx == y.intrinsics.fx && x.intrinsics.fy == y.intrinsics.fy && x.intrinsics.cx == y.intrinsics.cx &&
           x.intrinsics.cy == y.intrinsics.cy && x.intrinsics.distortion == y.intrinsics.distortion;
  });
}

TEST(CalibrationStore, NoByteChangesWithoutNotice) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  CalibrationRecord r = record();
  r.late = {0.001, 0, 0, 0.0025};
  store_calibration(file, r);
  const auto cameras = read_cameras(file);
  const auto late = read_time_offsets(file);
  const std::string sound = read_file_bytes(file, 1u << 20);
  int refused = 0, taken = 0;
  for (std::size_t at = 0; at < sound.size(); ++at)
    for (const unsigned change : {1u, 2u, 0x20u, 0xFFu}) {  // a digit becomes another one, a letter changes its case, a byte becomes none of ASCII
      std::string changed = sound;
      changed[at] = static_cast<char>(static_cast<unsigned char>(changed[at]) ^ change);
      fs::remove(file);  // a file that is overwritten in place is brought to the disk each time
      std::ofstream(file, std::ios::binary) << changed;
      try {
        EXPECT_TRUE(same_numbers(read_cameras(file), cameras)) << "byte " << at << " ^ " << change;
        EXPECT_EQ(read_time_offsets(file), late) << "byte " << at << " ^ " << change;
        ++taken;
      } catch (const std::runtime_error& e) {
        EXPECT_THAT(e.what(), testing::HasSubstr("calibration.toml")) << "byte " << at << " ^ " << change;
        ++refused;
      }
    }
  // Taken is only what makes another key of the word itself, or a comment of its line: all other bytes are as they were then.
  EXPECT_LE(taken, 4 * 12);
  EXPECT_GT(refused, 4 * 1000);
}

TEST(CalibrationStore, WhoEditsItTakesTheChecksumOut) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  store_calibration(file, record());
  std::string text = read_file_bytes(file, 1u << 20);
  text.replace(text.find("by = \""), 6, "by = \"Eve and ");
  write_file_atomically(file, text);
  EXPECT_THAT(complaint([&] { load_calibration(file); }), testing::AllOf(testing::HasSubstr("is damaged, or was edited"), testing::HasSubstr("line 4")));
  EXPECT_THAT(complaint([&] { confirm_calibration(file); }), testing::HasSubstr("is damaged, or was edited")) << "or damage would be made good";
  const auto line = text.find("checksum = ");
  text.erase(line, text.find('\n', line) + 1 - line);
  write_file_atomically(file, text);
  EXPECT_THAT(load_calibration(file).by, testing::StartsWith("Eve"));
  confirm_calibration(file);
  EXPECT_THAT(load_calibration(file).by, testing::StartsWith("Eve"));
  EXPECT_THAT(read_file_bytes(file, 1u << 20), testing::HasSubstr("checksum = \"crc64:"));
}

/// At true depth z a camera reads (1 + gain) z + offset: what the pipeline makes of a count is z again.
TEST(CalibrationStore, WhatWasFoundOfDepthIsWhatThePipelineUndoes) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  store_calibration(file, record());
  const hal::CameraDescription camera = load_calibration(file).cameras[2];
  const fit::Camera seen = fit_camera(camera);
  for (const double z : {1.0, 2.0, 3.5}) {
    const double count = ((1 + 0.00123) * z - 0.0045) / camera.depth_scale;
    EXPECT_NEAR(count * static_cast<double>(seen.depth_scale) + static_cast<double>(seen.depth_offset), z, 2e-6) << z;
  }
}

TEST(CalibrationStore, NonsenseIsNamed) {
  const Scratch scratch;
  const fs::path file = scratch.path / "calibration.toml";
  std::string text = calibration_text(record());
  const auto at = text.find("depth_gain = 0.00123");
  text.replace(at, 20, "depth_gain = nan");
  write_file_atomically(file, text);
  try {
    load_calibration(file);
    FAIL() << "a gain that is no number was taken";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("camera 'front-left' has a depth_gain outside -0.2 to 0.2"));
  }
  EXPECT_THROW(load_calibration(scratch.path / "absent.toml"), std::runtime_error);
}

TEST(ViewFolder, ViewsAreReadAsTheyWereWritten) {
  const Scratch scratch;
  ViewFolder out = create_view_folder(scratch.path / "views", simulated_cameras(1).planned);
  std::vector<hal::DepthFrame> frames(2);
  for (std::size_t i = 0; i < 2; ++i) {
    frames[i].camera = static_cast<hal::CameraIndex>(2 * i);
    frames[i].infrared.assign(512 * 424, static_cast<std::uint16_t>(100 + i));
    if (i == 0) frames[i].depth.assign(512 * 424, 2345);
  }
  write_view(out, frames);
  const ViewFolder in = open_view_folder(scratch.path / "views");
  EXPECT_EQ(in.views, 1);
  const auto back = read_view(in, 0);
  ASSERT_EQ(back.size(), 2u);
  EXPECT_EQ(hal::to_int(back[1].camera), 2);
  EXPECT_EQ(back[0].infrared, frames[0].infrared);
  EXPECT_EQ(back[0].depth, frames[0].depth);
  EXPECT_TRUE(back[1].depth.empty());
  EXPECT_THROW(create_view_folder(scratch.path / "views", in.cameras), std::runtime_error);
}

TEST(ViewFolder, WhatIsMissingOrBrokenIsNamed) {
  const Scratch scratch;
  EXPECT_THROW(open_view_folder(scratch.path), std::runtime_error);
  create_view_folder(scratch.path / "views", simulated_cameras(1).planned);
  try {
    open_view_folder(scratch.path / "views");
    FAIL() << "a folder without views was taken";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("there are no views"));
  }
  std::ofstream(scratch.path / "views/front-left/view-000.infrared.png") << "no picture";
  const ViewFolder folder = open_view_folder(scratch.path / "views");
  EXPECT_THROW(read_view(folder, 0), std::runtime_error);
  auto cameras = simulated_cameras(1).planned;
  cameras[0].name = "../outside";
  EXPECT_THROW(create_view_folder(scratch.path / "other", cameras), std::runtime_error);
}

BoardLook seen_at(double seconds, double x, std::initializer_list<int> cameras) {
  BoardLook look{seconds, {}, false};
  for (const int c : cameras) look.seen.push_back({c, Rigid{Eigen::Matrix3d::Identity(), {x, 0, 2}}});
  return look;
}

TEST(CaptureFlow, AViewIsTakenWhenTwoCamerasSeeTheBoardAtRestSomewhereNew) {
  CaptureFlow flow;
  EXPECT_EQ(flow.look({0, {}, false}), CaptureCue::search);
  EXPECT_EQ(flow.look({0.1, {}, true}), CaptureCue::wrong_board);
  EXPECT_EQ(flow.look(seen_at(0.2, 0, {1})), CaptureCue::search);
  EXPECT_EQ(flow.look(seen_at(0.3, 0, {0, 1})), CaptureCue::hold_still);
  EXPECT_EQ(flow.look(seen_at(0.6, 0.05, {0, 1})), CaptureCue::hold_still) << "it moved";
  EXPECT_EQ(flow.look(seen_at(1.2, 0.052, {0, 1})), CaptureCue::hold_still) << "not for long enough";
  EXPECT_EQ(flow.look(seen_at(1.5, 0.052, {0, 1})), CaptureCue::captured);
  EXPECT_EQ(flow.look(seen_at(1.8, 0.052, {0, 1})), CaptureCue::elsewhere);
  EXPECT_EQ(flow.look(seen_at(2.0, 0.3, {0, 1})), CaptureCue::hold_still);
  EXPECT_EQ(flow.look(seen_at(3.0, 0.3, {0, 1})), CaptureCue::captured);
  EXPECT_EQ(flow.look(seen_at(4.0, 0.3, {2, 3})), CaptureCue::hold_still) << "other cameras have to see it at rest too";
  EXPECT_EQ(flow.look(seen_at(5.0, 0.3, {2, 3})), CaptureCue::captured) << "the same numbers are another place to other cameras";
  EXPECT_EQ(flow.taken(), 3);
  flow.finish();
  EXPECT_EQ(flow.look(seen_at(6.0, 0.9, {0, 1})), CaptureCue::done);
}

}  // namespace
}  // namespace booth::tests
