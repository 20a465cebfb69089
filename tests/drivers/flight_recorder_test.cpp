// The recorder of the last moments: nothing lost, nothing torn, nothing written that must not be, and disks that are full or gone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <random>
#include <thread>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/recording/bag_file.hpp"
#include "drivers/recording/flight_recorder.hpp"
#include "drivers/recording/moment_ring.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/recording/sqlite.hpp"
#include "tests/conformance/sources.hpp"

namespace booth::drivers {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kWidth = 32, kHeight = 24;

std::vector<hal::CameraDescription> cameras() {
  std::vector<hal::CameraDescription> out(2);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].name = "c-" + std::to_string(i);
    out[i].serial = "serial " + std::to_string(i);
    out[i].intrinsics = {.width = kWidth, .height = kHeight, .fx = 30, .fy = 30.1, .cx = 16, .cy = 12, .distortion = {0.01, 0, 0, 0, 0}};
  }
  return out;
}

hal::DepthFrame frame_of(std::size_t camera, std::uint64_t number, hal::MonotonicTime at) {
  std::mt19937 random(static_cast<unsigned>(number * 2 + camera));
  hal::DepthFrame f;
  f.camera = static_cast<hal::CameraIndex>(camera);
  f.sequence = number;
  f.captured = at;
  f.depth.resize(kWidth * kHeight);
  for (auto& d : f.depth) d = static_cast<std::uint16_t>(random() % 5 ? 1000 + random() % 100 : 0);
  return f;
}

template <class F>
bool eventually(F condition) {
  for (int turn = 0; turn < 5000; ++turn, std::this_thread::sleep_for(2ms))
    if (condition()) return true;
  return false;
}

struct FlightRecorderTest : ::testing::Test {
  void build(bool depth, std::size_t memory = 8 << 20, std::uint64_t keep_free = 0) {
    settings.directory = directory;
    settings.depth = depth;
    settings.memory_bytes = memory;
    settings.keep_free_bytes = keep_free;
    recorder = make_flight_recorder(settings, cameras(), {}, clock);
  }
  /// Both cameras, with a pause in which the recorder empties its slots.
  void feed(std::uint64_t from, std::uint64_t count) {
    for (std::uint64_t n = from; n < from + count; ++n) {
      for (std::size_t c = 0; c < 2; ++c) recorder->frame(frame_of(c, n, start + std::chrono::milliseconds(33 * static_cast<int>(n)) + c * 3ms));
      hal::FittedGroup g;
      g.sequence = n;
      g.reference = start + std::chrono::milliseconds(33 * static_cast<int>(n));
      g.captured = {g.reference, g.reference + 3ms};
      g.q[5] = 0.1 * static_cast<double>(n);
      g.person = true;
      recorder->fitted(g);
      std::this_thread::sleep_for(2ms);
      if (n % 4 == 3) std::this_thread::sleep_for(12ms);
    }
  }
  hal::RecordingStatus snapshot() {
    EXPECT_EQ(recorder->snapshot("test"), "");
    EXPECT_TRUE(eventually([&] { return !recorder->status(false).snapshot.running; }));
    return recorder->status(false).snapshot;
  }
  std::vector<fs::path> written() const {
    std::vector<fs::path> out;
    if (fs::exists(directory))
      for (const auto& e : fs::directory_iterator(directory)) out.push_back(e.path());
    return out;
  }

  tests::ScratchFolder scratch;
  const fs::path directory = scratch.path() / "recordings";
  FlightRecorderSettings settings;
  SystemClock clock;
  hal::MonotonicTime start = clock.now();
  std::unique_ptr<hal::FlightRecorder> recorder;
};

TEST_F(FlightRecorderTest, ASnapshotHoldsWhatPassedToTheBit) {
  build(true);
  feed(0, 24);
  recorder->event("fault", "test", "a \"quoted\" thing\nhappened");
  std::this_thread::sleep_for(30ms);
  const auto status = snapshot();
  EXPECT_EQ(status.problem, "");
  EXPECT_EQ(status.frames + recorder->status(false).dropped, 48u);
  struct stat mode {};
  ::stat(directory.c_str(), &mode);
  EXPECT_EQ(mode.st_mode & 0777, 0700u) << "depth is personal data";

  auto source = open_recording(status.path, Pace::fast, std::make_shared<ManualClock>());
  ASSERT_EQ(source.cameras.size(), 2u);
  EXPECT_EQ(source.cameras[1]->description().name, "c-1");
  EXPECT_EQ(source.cameras[1]->description().serial, "serial 1") << "from the calibration beside the bag";
  ASSERT_EQ(source.live.groups.size(), 24u);
  EXPECT_EQ(source.live.groups[7].q[5], 0.1 * 7) << "bit for bit";
  EXPECT_EQ(source.live.groups[7].captured[1], start + 7 * 33ms + 3ms);
  for (auto& c : source.cameras) c->start();
  std::uint64_t seen = 0;
  for (std::size_t turn = 0; turn < status.frames; ++turn) {
    const std::size_t c = turn % 2;
    hal::DepthFrame f;
    if (source.cameras[c]->read(f, 1s) != hal::ReadStatus::frame) continue;
    const auto number = static_cast<std::uint64_t>((f.captured + source.live.to_live - start) / 33ms);
    EXPECT_EQ(f.captured + source.live.to_live, start + std::chrono::milliseconds(33 * static_cast<int>(number)) + c * 3ms) << "the live stamp again";
    EXPECT_EQ(f.depth, frame_of(c, number, start).depth);
    ++seen;
  }
  EXPECT_EQ(seen, status.frames);
}

TEST_F(FlightRecorderTest, DepthIsNeverWrittenUnlessConfigured) {
  build(false);
  feed(0, 8);
  EXPECT_THAT(recorder->record(true, false, 10, {}), HasSubstr("record.depth"));
  EXPECT_TRUE(written().empty());
  EXPECT_EQ(recorder->record(false, false, 10, {}), "");
  feed(8, 8);
  const auto shot = snapshot();
  recorder->stop();
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  EXPECT_EQ(recorder->status(false).recording.problem, "");
  EXPECT_EQ(shot.frames, 0u);
  recorder.reset();
  EXPECT_EQ(written().size(), 2u);
  for (const auto& folder : written())
    for (const auto& file : fs::directory_iterator(folder)) {
      std::ifstream in(file.path(), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(in), {}};
      EXPECT_EQ(bytes.find("Image"), std::string::npos) << file.path();
      EXPECT_EQ(bytes.find("depth/image_raw"), std::string::npos) << file.path();
    }
}

TEST_F(FlightRecorderTest, WithoutDepthARecordingOnRequestHasNone) {
  build(true);
  EXPECT_EQ(recorder->record(false, false, 10, {}), "");
  feed(0, 8);
  recorder->stop();
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  EXPECT_EQ(recorder->status(false).recording.frames, 0u);
}

TEST_F(FlightRecorderTest, UncompressedIsTheSame) {
  build(true);
  EXPECT_EQ(recorder->record(true, true, 10, {}), "");
  EXPECT_THAT(recorder->record(true, true, 10, {}), HasSubstr("running already"));
  feed(0, 12);
  recorder->stop();
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  const auto status = recorder->status(false).recording;
  EXPECT_GE(status.frames, 20u);
  auto source = open_recording(status.path, Pace::fast, std::make_shared<ManualClock>());
  for (auto& c : source.cameras) c->start();
  hal::DepthFrame f;
  ASSERT_EQ(source.cameras[0]->read(f, 1s), hal::ReadStatus::frame);
  EXPECT_EQ(f.depth, frame_of(0, static_cast<std::uint64_t>((f.captured + source.live.to_live - start) / 33ms), start).depth);
}

TEST_F(FlightRecorderTest, WhatWasHandedInBeforeTheEndIsInTheRecording) {
  // Images that take the packing thread far longer than the writing thread takes to hear of the end.
  auto large = cameras();
  for (auto& c : large) c.intrinsics.width = 1024, c.intrinsics.height = 848;
  settings.directory = directory;
  settings.depth = true;
  settings.memory_bytes = 64 << 20;
  settings.keep_free_bytes = 0;
  recorder = make_flight_recorder(settings, large, {}, clock);
  hal::DepthFrame frame;
  frame.depth.resize(1024 * 848);
  std::mt19937 random(3);
  for (auto& d : frame.depth) d = static_cast<std::uint16_t>(random() % 5 ? 1000 + random() % 100 : 0);
  EXPECT_EQ(recorder->record(true, false, 1000, {}), "");
  constexpr int kFrames = 6;  // fewer than there are slots: none is dropped
  for (int n = 0; n < kFrames; ++n) {
    frame.captured = start + n * 33ms;
    for (std::size_t c = 0; c < 2; ++c) frame.camera = static_cast<hal::CameraIndex>(c), recorder->frame(frame);
    hal::FittedGroup group;
    group.sequence = static_cast<std::uint64_t>(n);
    group.reference = frame.captured;
    recorder->fitted(group);
  }
  recorder->event("fault", "test", "the last word");
  recorder->stop();
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  const auto status = recorder->status(false);
  EXPECT_EQ(status.dropped, 0u);
  EXPECT_EQ(status.recording.frames, 2u * kFrames);
  EXPECT_EQ(open_recording(status.recording.path, Pace::fast, std::make_shared<ManualClock>()).live.groups.size(), static_cast<std::size_t>(kFrames));
  std::string bytes;
  for (const auto& file : fs::directory_iterator(status.recording.path)) {
    std::ifstream in(file.path(), std::ios::binary);
    bytes.append(std::istreambuf_iterator<char>(in), {});
  }
  EXPECT_THAT(bytes, HasSubstr("the last word"));
}

TEST_F(FlightRecorderTest, EndsByTimeAndWhenNobodyAsks) {
  build(true);
  EXPECT_EQ(recorder->record(true, false, 0.05, {}), "");
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  EXPECT_EQ(recorder->record(true, false, 1000, 100ms), "");
  std::this_thread::sleep_for(50ms);
  EXPECT_TRUE(recorder->status(true).recording.running);
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; })) << "whoever wanted it is gone";
}

TEST_F(FlightRecorderTest, ABusyRecorderDropsAndCounts) {
  build(true);
  const auto before = std::chrono::steady_clock::now();
  const hal::DepthFrame frame = frame_of(0, 1, start);  // made once: it takes longer to make one than to pack it
  for (int i = 0; i < 1000; ++i) recorder->frame(frame);
  EXPECT_GT(recorder->status(false).dropped, 0u);
  EXPECT_LT(std::chrono::steady_clock::now() - before, 20s);
}

TEST_F(FlightRecorderTest, AFolderThatCannotBeMadeIsASentence) {
  std::ofstream(scratch.path() / "file") << "x";
  settings.directory = scratch.path() / "file" / "recordings";
  recorder = make_flight_recorder(settings, cameras(), {}, clock);
  EXPECT_THAT(recorder->snapshot("test"), HasSubstr("record.directory"));
}

TEST_F(FlightRecorderTest, StopsBeforeTheDiskIsFull) {
  build(true, 8 << 20, std::uint64_t{1} << 60);
  EXPECT_EQ(recorder->record(true, false, 10, {}), "");
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  EXPECT_THAT(recorder->status(false).recording.problem, HasSubstr("record.keep_free_bytes"));
}

TEST_F(FlightRecorderTest, AFullDiskCostsTheEndNotTheBag) {
  fs::create_directory(directory);
  if (::mount("booth-test", directory.c_str(), "tmpfs", 0, "size=2m") != 0) GTEST_SKIP() << "skipped: no file system can be mounted here (root is needed)";
  build(true);
  EXPECT_EQ(recorder->record(true, true, 1000, {}), "");
  for (std::uint64_t n = 0; n < 4000 && recorder->status(false).recording.running; n += 8) feed(n, 8);
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  const auto status = recorder->status(false).recording;
  EXPECT_THAT(status.problem, HasSubstr("check the disk's space"));
  EXPECT_TRUE(fs::exists(status.path)) << status.problem;
  if (fs::exists(status.path)) {
    auto source = open_recording(status.path, Pace::fast, std::make_shared<ManualClock>());
    source.cameras[0]->start();
    hal::DepthFrame f;
    EXPECT_EQ(source.cameras[0]->read(f, 1s), hal::ReadStatus::frame);
  }
  // Room again: the next one goes well.
  fs::remove_all(status.path);
  EXPECT_EQ(recorder->record(true, false, 0.05, {}), "");
  ASSERT_TRUE(eventually([&] { return !recorder->status(false).recording.running; }));
  EXPECT_EQ(recorder->status(false).recording.problem, "");
  recorder.reset();
  ::umount2(directory.c_str(), MNT_DETACH);
}

TEST_F(FlightRecorderTest, WhatADeadProcessLeftIsFinished) {
  const pid_t child = ::fork();
  if (child == 0) {
    build(true);
    recorder->record(true, false, 1000, {});
    std::this_thread::sleep_for(200ms);
    for (std::uint64_t n = 0;; n += 8) feed(n, 8);
  }
  ASSERT_GT(child, 0);
  // Two transactions are on the disk; the third is torn somewhere.
  std::this_thread::sleep_for(2600ms);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ASSERT_EQ(written().size(), 1u);
  EXPECT_THAT(written()[0].string(), HasSubstr(".partial-"));
  const auto said = recover_bags(directory);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("was interrupted"));
  ASSERT_EQ(written().size(), 1u) << said[0];
  EXPECT_THAT(written()[0].string(), HasSubstr("-record"));
  auto source = open_recording(written()[0], Pace::fast, std::make_shared<ManualClock>());
  source.cameras[0]->start();
  hal::DepthFrame f;
  EXPECT_EQ(source.cameras[0]->read(f, 1s), hal::ReadStatus::frame);
  EXPECT_TRUE(fs::exists(written()[0] / "interrupted.txt"));
  EXPECT_TRUE(recover_bags(directory).empty()) << "once is enough";
}

TEST(Recovery, ABagThatCannotBeBegunLeavesNothing) {
  const tests::ScratchFolder scratch;
  // Files must not grow, which needs no full disk.
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit none{1000, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &none);
  EXPECT_THROW(BagFile(scratch.path() / "full"), std::runtime_error);
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(Recovery, RemovesWhatIsEmptyAndSaysWhatIsBroken) {
  const tests::ScratchFolder scratch;
  fs::create_directory(scratch.path() / "a.partial-123456");
  fs::create_directory(scratch.path() / "b.partial-123456");
  std::ofstream(scratch.path() / "b.partial-123456" / "b_0.db3") << std::string(5000, 'x');
  const auto said = recover_bags(scratch.path());
  ASSERT_EQ(said.size(), 2u);
  EXPECT_THAT(said[0], HasSubstr("removed"));
  EXPECT_THAT(said[1], HasSubstr("cannot be finished"));
  EXPECT_FALSE(fs::exists(scratch.path() / "a.partial-123456"));
}

/// The pages of the index over time, its root first.
std::vector<std::int64_t> index_pages(const fs::path& file) {
  const Database db = open_database(file, SQLITE_OPEN_READONLY);
  std::vector<std::int64_t> out{number_of(db, file, "SELECT rootpage FROM sqlite_master WHERE name = 'timestamp_idx'")};
  std::ifstream in(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  for (std::size_t page = 1; 4096 * page < bytes.size(); ++page)
    if (bytes[4096 * page] == 0x0a) out.push_back(static_cast<std::int64_t>(page) + 1);  // a leaf of an index, and there is one index
  return out;
}

void bad_index(std::size_t which, char with) {
  const tests::ScratchFolder scratch;
  const fs::path partial = scratch.path() / "c.partial-123456", file = partial / "c_0.db3";
  {
    BagFile bag(scratch.path() / "c");
    const std::size_t topic = bag.add_topic("/t", "std_msgs/msg/String", false);
    const std::string text(100, 't');
    for (int n = 0; n < 3000; ++n) bag.insert(topic, hal::UtcTime(std::chrono::seconds(n)), text);
    bag.close();
  }
  fs::rename(scratch.path() / "c", partial);
  fs::remove(partial / "metadata.yaml");
  const auto pages = index_pages(file);
  ASSERT_GT(pages.size(), 5u);
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp((pages[which] - 1) * 4096);
    bytes << std::string(4096, with);
  }
  const auto said = recover_bags(scratch.path());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("3000 messages of it were saved"));
  EXPECT_TRUE(fs::exists(scratch.path() / "c" / "metadata.yaml"));
}

TEST(Recovery, ABadPageOfTheIndexCostsNoMessage) {
  for (const std::size_t which : {0u, 4u})
    for (const char with : {'\0', '\xff'}) bad_index(which, with);
}

TEST(Recovery, WhatCannotBeCountedIsNotEmpty) {
  const tests::ScratchFolder scratch;
  const fs::path partial = scratch.path() / "d.partial-123456", file = partial / "d_0.db3";
  {
    BagFile bag(scratch.path() / "d");
    const std::size_t topic = bag.add_topic("/t", "std_msgs/msg/String", false);
    for (int n = 0; n < 3000; ++n) bag.insert(topic, hal::UtcTime(std::chrono::seconds(n)), std::string(100, 't'));
    bag.close();
  }
  fs::rename(scratch.path() / "d", partial);
  const auto size = static_cast<std::streamoff>(fs::file_size(file));
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekp(4096);
    bytes << std::string(static_cast<std::size_t>(size - 4096), '\xff');  // all but the head, which says what tables there are
  }
  const auto said = recover_bags(scratch.path());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("cannot be finished"));
  EXPECT_TRUE(fs::exists(file)) << "it is not ours to delete";
}

TEST(MomentRing, HandsOutWhatItHoldsInOrder) {
  MomentRing ring(10'000, 1h);
  std::mt19937 random(1);
  std::uint64_t pushed = 0, next = 0, missed = 0;
  MomentRing::Cursor cursor = ring.oldest();
  std::vector<std::byte> bytes;
  Moment moment;
  for (int turn = 0; turn < 5000; ++turn) {
    std::vector<std::byte> data(8 + random() % 2000, static_cast<std::byte>(pushed));
    std::memcpy(data.data(), &pushed, 8);
    ASSERT_TRUE(ring.push({Moment::Kind::depth, 1, hal::MonotonicTime(1ns * static_cast<int>(pushed))}, data));
    ++pushed;
    EXPECT_LE(ring.held_bytes(), ring.capacity());
    if (random() % 3) continue;
    for (int n = static_cast<int>(random() % 6); n > 0; --n) {
      const std::uint64_t before = missed;
      if (!ring.read(cursor, moment, bytes, missed)) {
        EXPECT_EQ(next, pushed);
        break;
      }
      next += missed - before;
      std::uint64_t number;
      std::memcpy(&number, bytes.data(), 8);
      ASSERT_EQ(number, next);
      if (bytes.size() > 8) {
        ASSERT_EQ(bytes.back(), static_cast<std::byte>(number));
      }
      ++next;
    }
  }
  EXPECT_GT(missed, 0u);
  EXPECT_FALSE(ring.push({}, std::vector<std::byte>(20'000))) << "more than it has";
}

TEST(MomentRing, ForgetsWhatIsOld) {
  MomentRing ring(100'000, 10s);
  for (int s = 0; s < 100; ++s) ASSERT_TRUE(ring.push({Moment::Kind::event, 0, hal::MonotonicTime(1s * s)}, std::vector<std::byte>(10)));
  EXPECT_EQ(ring.held_time(), 10s);
}

}  // namespace
}  // namespace booth::drivers
