// A recording in which one camera's frames are missing for a while is replayed to its end, with every frame that is there.
#include <gtest/gtest.h>

#include "daemon/record/replay.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/recording/recording.hpp"
#include "drivers/recording/rosbag2_writer.hpp"
#include "drivers/recording/rvl.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kPixels = 32 * 24;
constexpr int kFrames = 60, kGapFrom = 10, kGapTo = 40;

std::vector<hal::CameraDescription> cameras() {
  std::vector<hal::CameraDescription> out(2);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].name = "c" + std::to_string(i);
    out[i].intrinsics = {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 16, .cy = 12, .distortion = {}};
  }
  return out;
}

TEST(Replay, GoesOnBehindFramesThatOneCameraLost) {
  const tests::TemporaryFolder folder;
  drivers::Rosbag2Writer bag(folder.path / "bag", cameras(), std::nullopt, {}, {.compressed = true, .depth = true, .groups = true});
  const hal::Nanoseconds offset = std::chrono::hours(500'000);
  std::vector<std::uint16_t> picture(kPixels, 1000);
  std::vector<std::byte> packed(drivers::rvl_bound(kPixels));
  for (int n = 0; n < kFrames; ++n) {
    const bool both = n < kGapFrom || n >= kGapTo;
    hal::FittedGroup group;
    group.sequence = static_cast<std::uint64_t>(n);
    group.person = true;
    group.reference = hal::MonotonicTime(10s + n * 33ms);
    group.q[0] = n;  // what the fitter below finds
    for (std::size_t c = 0; c < (both ? 2u : 1u); ++c) {
      group.captured[c] = group.reference + static_cast<int>(c) * 3ms;
      picture[7] = static_cast<std::uint16_t>(2 * n + static_cast<int>(c));
      bag.write_packed(c, {packed.data(), drivers::rvl_pack(picture, packed.data())}, hal::UtcTime(group.captured[c].time_since_epoch() + offset));
    }
    bag.write_group(group, offset);
  }
  bag.close();

  auto source = drivers::open_recording(folder.path / "bag", drivers::Pace::fast, std::make_shared<drivers::SystemClock>());
  ASSERT_EQ(source.live.groups.size(), static_cast<std::size_t>(kFrames));
  tests::FakeFitter fitter;
  int pairs = 0;
  const ReplayCounters c = run_replay(source.cameras, source.live.groups, source.live.to_live, fitter, [&](const FitInput& input, const FrameRecord&) {
    const auto n = static_cast<int>(input.frame);
    ASSERT_NE(input.frames[0], nullptr);
    EXPECT_EQ(input.frames[0]->depth[7], 2 * n);
    if (!input.frames[1]) return;
    ++pairs;
    EXPECT_EQ(input.frames[1]->depth[7], 2 * n + 1);
  });
  EXPECT_EQ(c.groups, static_cast<std::uint64_t>(kFrames));
  EXPECT_EQ(c.identical, c.groups);
  EXPECT_EQ(c.skipped, 0u);
  EXPECT_EQ(pairs, kFrames - (kGapTo - kGapFrom));
}

}  // namespace
}  // namespace booth::daemon
