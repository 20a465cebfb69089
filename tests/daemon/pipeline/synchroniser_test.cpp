// Grouping: all phases, jitter, a lost frame, a dying camera, one camera alone, and what time does to incomplete groups.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "daemon/pipeline/synchroniser.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using hal::MonotonicTime;
using hal::Nanoseconds;

constexpr Nanoseconds kPeriod(33'333'333);
constexpr MonotonicTime at(Nanoseconds t) { return MonotonicTime(10s) + t; }

struct Arrival {
  int camera;
  Nanoseconds captured;
};

struct Playback {
  std::vector<FrameGroup> groups;
  std::uint64_t dropped = 0;
};

/// Plays arrivals in the order of time, each with a slot of its own, and checks what must hold always: every slot is given back or handed out exactly
/// once, every frame lies within the window, groups come in order.
Playback play(std::vector<Arrival> arrivals, SynchroniserSettings settings, Nanoseconds delay = 10ms, Nanoseconds polling = 5ms) {
  std::stable_sort(arrivals.begin(), arrivals.end(), [](const Arrival& a, const Arrival& b) { return a.captured < b.captured; });
  Synchroniser synchroniser(settings);
  Playback run;
  std::set<std::pair<int, int>> outstanding;
  const auto take = [&](const ReleasedSlots& released) {
    for (const auto& e : released.list()) EXPECT_EQ(outstanding.erase({e.camera, e.slot}), 1u) << "a slot was released twice";
  };
  const auto poll = [&](MonotonicTime now) {
    FrameGroup group;
    for (bool more = true; more;) {
      ReleasedSlots released;
      more = synchroniser.next(now, group, released);
      take(released);
      if (!more) break;
      int cameras = 0;
      for (int cam = 0; cam < settings.cameras; ++cam) {
        const auto c = static_cast<std::size_t>(cam);
        if (group.slot[c] < 0) continue;
        ++cameras;
        EXPECT_EQ(outstanding.erase({cam, group.slot[c]}), 1u) << "a frame was used twice";
        EXPECT_LE(std::chrono::abs(group.captured[c] - group.reference), settings.window);
      }
      EXPECT_EQ(cameras, group.cameras);
      EXPECT_GT(cameras, 0);
      if (!run.groups.empty()) {
        EXPECT_GT(group.reference, run.groups.back().reference);
      }
      run.groups.push_back(group);
    }
  };
  int slot = 0;
  MonotonicTime now = at(-100ms);
  for (const Arrival& a : arrivals) {
    for (; now < at(a.captured + delay); now += polling) poll(now);
    outstanding.insert({a.camera, slot});
    ReleasedSlots released;
    synchroniser.add({a.camera, at(a.captured), slot++}, at(a.captured + delay), released);
    take(released);
    poll(at(a.captured + delay));
  }
  poll(MonotonicTime::max());
  EXPECT_TRUE(outstanding.empty()) << outstanding.size() << " slots were never given back";
  run.dropped = synchroniser.frames_dropped();
  return run;
}

std::vector<Arrival> free_running(const std::vector<Nanoseconds>& phases, int frames, Nanoseconds jitter = 0ns, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::int64_t> spread(-jitter.count(), jitter.count());
  std::vector<Arrival> out;
  for (std::size_t cam = 0; cam < phases.size(); ++cam) {
    for (int k = 0; k < frames; ++k) out.push_back({static_cast<int>(cam), phases[cam] + k * kPeriod + Nanoseconds(spread(random))});
  }
  return out;
}

int with_cameras(const Playback& run, int cameras) {
  return static_cast<int>(std::count_if(run.groups.begin(), run.groups.end(), [&](const FrameGroup& g) { return g.cameras == cameras; }));
}

class EveryOrder : public ::testing::TestWithParam<GroupOrder> {};
INSTANTIATE_TEST_SUITE_P(Synchroniser, EveryOrder, ::testing::Values(GroupOrder::newest_first, GroupOrder::oldest_first),
                         [](const auto& p) { return p.param == GroupOrder::newest_first ? "newest_first" : "oldest_first"; });

TEST_P(EveryOrder, GroupsAllFourCamerasAtEveryPhase) {
  constexpr int kFrames = 20, kSteps = 7;
  for (int a = 0; a < kSteps; ++a) {
    for (int b = 0; b < kSteps; ++b) {
      for (int c = 0; c < kSteps; ++c) {
        const std::vector<Nanoseconds> phases{0ns, a * kPeriod / kSteps, b * kPeriod / kSteps, c * kPeriod / kSteps};
        const Playback run = play(free_running(phases, kFrames, 500us, static_cast<unsigned>(a * 49 + b * 7 + c)), {.cameras = 4, .order = GetParam()});
        // A full group for every period but the ragged ends.
        EXPECT_GE(with_cameras(run, 4), kFrames - 2) << a << " " << b << " " << c;
        EXPECT_LE(run.groups.size(), kFrames + 2u);
      }
    }
  }
}

TEST_P(EveryOrder, TwoCamerasInOppositePhase) {
  const Playback run = play(free_running({0ns, kPeriod / 2}, 30), {.cameras = 2, .order = GetParam()});
  EXPECT_GE(with_cameras(run, 2), 29);
}

TEST_P(EveryOrder, OneCameraAlone) {
  const Playback run = play(free_running({3ms}, 30), {.cameras = 1, .order = GetParam()});
  EXPECT_EQ(run.groups.size(), 30u);
  EXPECT_EQ(run.dropped, 0u);
}

TEST_P(EveryOrder, OneCameraOfFour) {
  auto arrivals = free_running({3ms}, 30);
  for (auto& a : arrivals) a.camera = 2;
  const Playback run = play(arrivals, {.cameras = 4, .order = GetParam()});
  EXPECT_GE(run.groups.size(), 24u) << "the silent three are waited for at first, then no more";
  for (const FrameGroup& g : run.groups) EXPECT_EQ(g.slot[0], -1);
}

TEST_P(EveryOrder, ACameraThatDiesAndComesBack) {
  auto arrivals = free_running({0ns, 8ms, 16ms, 24ms}, 60);
  std::erase_if(arrivals, [](const Arrival& a) { return a.camera == 3 && a.captured > 20 * kPeriod && a.captured < 40 * kPeriod; });
  const Playback run = play(arrivals, {.cameras = 4, .order = GetParam()});
  EXPECT_GE(with_cameras(run, 4), 36);
  EXPECT_GE(with_cameras(run, 3), 15);
  EXPECT_GE(run.groups.back().cameras, 1);
}

TEST_P(EveryOrder, ALostFrameCostsAtMostItsOwnGroup) {
  auto arrivals = free_running({0ns, 3ms, 10ms, 20ms}, 30);
  std::erase_if(arrivals, [](const Arrival& a) { return a.camera == 3 && a.captured == 20ms + 12 * kPeriod; });
  const Playback run = play(arrivals, {.cameras = 4, .order = GetParam()});
  EXPECT_EQ(with_cameras(run, 4), 29);
  if (GetParam() == GroupOrder::oldest_first) {
    EXPECT_EQ(run.groups.size(), 30u);
    EXPECT_EQ(run.dropped, 0u) << "offline nothing is dropped";
  }
}

TEST(Synchroniser, WaitsForABetterGroupThanALoneFrame) {
  // Camera 1 always comes 31.5 ms after camera 0: too late for that frame, early for the next.
  const Playback run = play(free_running({0ns, 31500us}, 30), {.cameras = 2});
  EXPECT_GE(with_cameras(run, 2), 29);
  EXPECT_LE(with_cameras(run, 1), 2);
}

TEST(Synchroniser, ACameraThatComesSeldomDoesNotHoldTheOthersBack) {
  auto arrivals = free_running({0ns, 8ms, 16ms, 24ms}, 60);
  int count = 0;
  std::erase_if(arrivals, [&](const Arrival& a) { return a.camera == 3 && count++ % 4 != 0; });
  const Playback run = play(arrivals, {.cameras = 4});
  EXPECT_GE(run.groups.size(), 40u) << "the newest whole group may overtake one that still waited";
  EXPECT_GE(with_cameras(run, 4), 12);
}

TEST(Synchroniser, LateDeliveryDoesNotSplitGroups) {
  // Camera 3's frames take 45 ms longer than the others'.
  Synchroniser synchroniser({.cameras = 4});
  std::vector<FrameGroup> groups;
  for (int ms = 0; ms < 1100; ++ms) {
    ReleasedSlots released;
    for (int cam = 0; cam < 4; ++cam) {
      const int taken = ms - (cam == 3 ? 55 : 10) - 2 * cam;
      if (taken >= 0 && taken % 33 == 0) synchroniser.add({cam, at((taken + 2 * cam) * 1ms), taken}, at(ms * 1ms), released);
    }
    FrameGroup group;
    if (ReleasedSlots unused; synchroniser.next(at(ms * 1ms), group, unused)) groups.push_back(group);
  }
  EXPECT_GE(groups.size(), 31u);
  for (const FrameGroup& g : groups) EXPECT_EQ(g.cameras, 4);
}

TEST(Synchroniser, TheNewestGroupWinsWhenAskedLate) {
  Synchroniser synchroniser({.cameras = 2});
  ReleasedSlots released;
  for (int k = 0; k < 3; ++k) {
    for (int cam = 0; cam < 2; ++cam) synchroniser.add({cam, at(k * kPeriod + cam * 5ms), 10 * cam + k}, at(3 * kPeriod), released);
  }
  EXPECT_EQ(released.count, 0);
  FrameGroup group;
  ASSERT_TRUE(synchroniser.next(at(3 * kPeriod), group, released));
  EXPECT_EQ(group.slot[0], 2);
  EXPECT_EQ(group.slot[1], 12);
  EXPECT_EQ(group.skipped, 2u) << "two whole groups were overtaken";
  EXPECT_EQ(released.count, 4);
  EXPECT_FALSE(synchroniser.next(at(3 * kPeriod), group, released));
}

TEST(Synchroniser, TheReferenceIsInTheMiddle) {
  Synchroniser synchroniser({.cameras = 3});
  ReleasedSlots released;
  synchroniser.add({0, at(0ms), 0}, at(0ms), released);
  synchroniser.add({1, at(30ms), 0}, at(30ms), released);
  synchroniser.add({2, at(12ms), 0}, at(12ms), released);
  FrameGroup group;
  ASSERT_TRUE(synchroniser.next(at(31ms), group, released));
  EXPECT_EQ(group.reference, at(15ms));
  EXPECT_EQ(group.cameras, 3);
}

TEST(Synchroniser, ThirtyMillisecondsIsTheLimit) {
  Synchroniser synchroniser({.cameras = 2});
  ReleasedSlots released;
  synchroniser.add({0, at(0ms), 0}, at(0ms), released);
  synchroniser.add({1, at(30ms) + 1ns, 0}, at(31ms), released);
  FrameGroup group;
  EXPECT_FALSE(synchroniser.next(at(31ms), group, released)) << "neither frame alone is a whole group, and both may still find a partner";
  EXPECT_FALSE(synchroniser.next(at(74ms), group, released));
  ASSERT_TRUE(synchroniser.next(at(75ms), group, released));
  EXPECT_EQ(group.cameras, 1);
}

TEST(Synchroniser, AFrameOutOfOrderIsGivenBack) {
  Synchroniser synchroniser({.cameras = 1});
  ReleasedSlots released;
  synchroniser.add({0, at(10ms), 1}, at(10ms), released);
  synchroniser.add({0, at(10ms), 2}, at(10ms), released);
  synchroniser.add({0, at(5ms), 3}, at(5ms), released);
  ASSERT_EQ(released.count, 2);
  EXPECT_EQ(released.entry[0].slot, 2);
  EXPECT_EQ(released.entry[1].slot, 3);
  EXPECT_EQ(synchroniser.frames_dropped(), 2u);
}

/// Four cameras at 30 frames/s, one of which may say a wrong time; counts the groups, and those that hold all four.
struct FourCameras {
  Synchroniser synchroniser{SynchroniserSettings{.cameras = 4}};
  int slot = 0, whole = 0, groups = 0;
  /// One period whose frames come 10 ms after they were taken. Camera 2's stamp is wrong by `wrong`.
  void period(int k, Nanoseconds wrong = 0ns) {
    for (int cam = 0; cam < 4; ++cam) {
      const MonotonicTime taken = at(k * kPeriod + cam * 2ms);
      ReleasedSlots released;
      synchroniser.add({cam, taken + (cam == 2 ? wrong : 0ns), slot++}, taken + 10ms, released);
      FrameGroup group;
      for (bool more = true; more;) {
        ReleasedSlots unused;
        more = synchroniser.next(taken + 10ms, group, unused);
        groups += more;
        whole += more && group.cameras == 4;
      }
    }
  }
};

TEST(Synchroniser, AStampFromTheFutureBlocksNobody) {
  for (const Nanoseconds wrong : {Nanoseconds(300ms), Nanoseconds(1h), Nanoseconds(std::int64_t{200} * 365 * 24 * 3600 * 1'000'000'000)}) {
    FourCameras booth;
    for (int k = 0; k < 10; ++k) booth.period(k);
    const int before = booth.whole;
    EXPECT_GE(before, 9);
    booth.period(10, wrong);
    EXPECT_EQ(booth.synchroniser.frames_dropped(), 1u) << "counted as every frame that is in no group";
    for (int k = 11; k < 41; ++k) booth.period(k);
    EXPECT_GE(booth.whole - before, 29) << "the camera itself is back with its next frame";
  }
}

TEST(Synchroniser, ACameraWhoseStampsAreAllFromTheFutureIsAnAbsentOne) {
  FourCameras booth;
  for (int k = 0; k < 40; ++k) booth.period(k, 1h);
  EXPECT_GE(booth.synchroniser.frames_dropped(), 40u);
  EXPECT_GE(booth.groups, 30) << "the other three go on";
  for (int k = 40; k < 60; ++k) booth.period(k);
  EXPECT_GE(booth.whole, 19);
}

TEST(Synchroniser, ASingleCameraIsMeasuredByTheClock) {
  Synchroniser synchroniser({.cameras = 1});
  ReleasedSlots released;
  FrameGroup group;
  synchroniser.add({0, at(1h), 0}, at(10ms), released);
  EXPECT_EQ(released.count, 1);
  synchroniser.add({0, at(33ms), 1}, at(43ms), released);
  EXPECT_TRUE(synchroniser.next(at(43ms), group, released));
}

TEST(Synchroniser, SourcesWithATimeOfTheirOwnAreTakenByTheirNeighbours) {
  // A recording that is played as fast as it can be read: hours in minutes, and after a while ahead of the clock.
  Synchroniser synchroniser({.cameras = 2});
  int groups = 0;
  for (int k = 0; k < 100; ++k) {
    for (int cam = 0; cam < 2; ++cam) {
      ReleasedSlots released;
      synchroniser.add({cam, at(k * kPeriod + cam * 3ms), k}, at(0ms), released);
      EXPECT_EQ(released.count, 0);
      FrameGroup group;
      groups += synchroniser.next(at(0ms), group, released);
    }
  }
  EXPECT_EQ(groups, 100);
}

TEST(Synchroniser, LateCamerasDoNotTakeTheFitBackInTime) {
  // Cameras 2 and 3 are read 100 ms late (their threads had no processor): their pair lies before the group of the others.
  Synchroniser synchroniser({.cameras = 4});
  ReleasedSlots released;
  FrameGroup group;
  synchroniser.add({0, at(4ms), 1}, at(4ms), released);
  synchroniser.add({1, at(6ms), 1}, at(6ms), released);
  ASSERT_TRUE(synchroniser.next(at(90ms), group, released));
  EXPECT_EQ(group.reference, at(5ms));
  synchroniser.add({2, at(1ms), 7}, at(1ms), released);
  synchroniser.add({3, at(2ms), 8}, at(2ms), released);
  EXPECT_EQ(released.count, 2);
  EXPECT_FALSE(synchroniser.next(at(200ms), group, released));
  EXPECT_EQ(synchroniser.frames_dropped(), 2u);
  // They are waited for again.
  synchroniser.add({0, at(37ms), 2}, at(37ms), released);
  synchroniser.add({1, at(39ms), 2}, at(39ms), released);
  EXPECT_FALSE(synchroniser.next(at(60ms), group, released));
  synchroniser.add({2, at(34ms), 9}, at(34ms), released);
  synchroniser.add({3, at(35ms), 10}, at(35ms), released);
  ASSERT_TRUE(synchroniser.next(at(60ms), group, released));
  EXPECT_EQ(group.cameras, 4);
}

TEST(Synchroniser, RandomArrivalsNeverLoseASlot) {
  // play() checks the bookkeeping; here cameras come and go, and time stamps are wild.
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    std::vector<Arrival> arrivals;
    for (int i = 0; i < 300; ++i) arrivals.push_back({static_cast<int>(random() % 8), Nanoseconds(static_cast<std::int64_t>(random() % 2'000'000'000u))});
    for (const GroupOrder order : {GroupOrder::newest_first, GroupOrder::oldest_first}) play(arrivals, {.cameras = 8, .order = order});
  }
}

TEST(Synchroniser, RefusesNonsense) {
  EXPECT_THROW(Synchroniser({.cameras = 0}), std::invalid_argument);
  EXPECT_THROW(Synchroniser({.cameras = 9}), std::invalid_argument);
}

}  // namespace
}  // namespace booth::daemon
