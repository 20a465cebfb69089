// From READY on nothing is allocated on the frame path, whatever happens to people and cameras, and resident memory stays what it is.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iostream>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/support/allocation_count.hpp"
#include "tests/support/eager_clock.hpp"
#include "tests/support/memory_booth.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;

/// BOOTHD_FRAMES makes it long.
std::uint64_t frames_wanted(std::uint64_t otherwise) {
  const char* text = std::getenv("BOOTHD_FRAMES");
  return text ? std::strtoull(text, nullptr, 10) : otherwise;
}

double resident_megabytes() {
  std::ifstream in("/proc/self/statm");
  long all = 0, resident = 0;
  in >> all >> resident;
  return static_cast<double>(resident) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1048576.0;
}

/// Two seconds of somebody who is there for one and a half, in cameras of a quarter of the pixels, again and again.
const FrameMemory& memory() {
  static const FrameMemory m = [] {
    SceneRequest request;
    request.motion = "wave", request.seconds = 2, request.leaves = 1.5, request.divisor = 2;
    return render_frames(request);
  }();
  return m;
}

struct FramePath : ::testing::Test {
  EagerClock clock;
  MemoryBooth booth;
  explicit FramePath(bool ros2 = false) : booth(memory(), clock, {.threads = 2, .notes = 0, .decode = {}, .ros2 = ros2}) {}

  bool run_until(std::uint64_t frames) {
    // The fit is what time waits for; where no frame comes (too few cameras), time goes on by itself.
    return eventually([&] { return booth.frames() >= frames; }, std::chrono::minutes(60));
  }
  void SetUp() override {
    ASSERT_TRUE(run_until(1));
    pace_ = std::thread([this] {
      for (std::uint64_t seen = 0; !stop_;) {
        if (const std::uint64_t n = booth.frames(); n != seen)
          seen = n, clock.period_done(33'333'333ns);
        else
          std::this_thread::sleep_for(500us);
      }
    });
  }
  void TearDown() override {
    stop_ = true;
    if (pace_.joinable()) pace_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread pace_;
};

TEST_F(FramePath, AllocatesNothingFromReadyOn) {
  if (!AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  const std::uint64_t wanted = frames_wanted(300);
  ASSERT_TRUE(run_until(5));  // sessions begin with a folder and a thread; the frame path has been entered
  const std::uint64_t first = booth.frames();
  // Cyclone DDS takes memory for each sample that it hands on; bounded below.
  const AllocationCount count({"libddsc"});
  int losses = 0;
  std::uint64_t next_loss = first + wanted / 4;
  const std::uint64_t between_losses = std::max<std::uint64_t>(wanted / 4, 100);
  while (booth.frames() < first + wanted) {
    ASSERT_TRUE(run_until(std::min(next_loss, first + wanted)));
    if (booth.frames() >= first + wanted) break;
    MemoryCamera& camera = booth.camera(static_cast<std::size_t>(losses) % 4);
    camera.lost = true;
    ++losses;
    ASSERT_TRUE(eventually([&] { return booth.pipeline().cameras_running() == 3; }, 60s));
    camera.lost = false;
    ASSERT_TRUE(eventually([&] { return booth.pipeline().cameras_running() == 4; }, 60s));
    next_loss = booth.frames() + between_losses;
  }
  const std::uint64_t frames = booth.frames() - first;
  EXPECT_EQ(count.on_frame_threads(), 0u) << count.first_places();
  // A camera that was lost says why, in a text, and is started again: not the frame path, and no more than this.
  EXPECT_LE(count.on_camera_threads(), 16u * static_cast<unsigned>(losses)) << count.first_places();
  EXPECT_LE(count.excused_on_frame_threads(), 8 * frames) << "Cyclone DDS";
  EXPECT_GE(losses, 2);
  std::cout << frames << " frames, " << losses << " cameras lost and back: " << count.on_frame_threads() << " allocations on the frame path, "
            << count.on_camera_threads() << " to bring cameras back, " << static_cast<double>(count.excused_on_frame_threads()) / static_cast<double>(frames)
            << " a frame by Cyclone DDS\n";
}

/// The same with the ROS 2 mirror, whose thread carries frames, too.
struct FramePathRos2 : FramePath {
  FramePathRos2() : FramePath(true) {}
};

TEST_F(FramePathRos2, AllocatesNothingFromReadyOn) {
  if (!AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  const std::uint64_t wanted = frames_wanted(100);
  ASSERT_TRUE(run_until(5));
  const std::uint64_t first = booth.frames();
  const AllocationCount count({"libddsc"});
  ASSERT_TRUE(run_until(first + wanted));
  const std::uint64_t frames = booth.frames() - first;
  EXPECT_EQ(count.on_frame_threads(), 0u) << count.first_places();
  // One sample of each of the booth's own topics and up to five of the mirror's.
  EXPECT_LE(count.excused_on_frame_threads(), 6 * 8 * frames) << "Cyclone DDS";
  std::cout << frames << " frames with the ROS 2 mirror: " << count.on_frame_threads() << " allocations on the frame path, "
            << static_cast<double>(count.excused_on_frame_threads()) / static_cast<double>(frames) << " a frame by Cyclone DDS\n";
}

TEST_F(FramePath, ResidentMemoryStaysWhatItIs) {
  // A minute and an hour are 1,800 and 108,000 frames: BOOTHD_FRAMES=108000.
  const std::uint64_t wanted = frames_wanted(400), minute = std::min<std::uint64_t>(1800, wanted / 2);
  ASSERT_TRUE(run_until(minute));
  const double after_minute = resident_megabytes();
  ASSERT_TRUE(run_until(wanted));
  const double at_end = resident_megabytes();
  std::cout << "after " << minute << " frames " << after_minute << " MiB, after " << wanted << " frames " << at_end << " MiB\n";
#ifndef BOOTHD_SANITIZED
  EXPECT_NEAR(at_end, after_minute, 1.0);
#endif
  EXPECT_GT(booth.heard(), 0u) << "the DDS reader heard nothing";
}

}  // namespace
}  // namespace booth::tests
