// The order in which a camera in trouble is helped.
#include "drivers/kinect2/recovery_ladder.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;

TEST(RecoveryLadder, ClimbsOneRungForEachStall) {
  RecoveryLadder ladder;
  for (const Rung expected :
       {Rung::restart_stream, Rung::reopen, Rung::reboot, Rung::reset_port, Rung::rebind_controller, Rung::ask_for_help, Rung::ask_for_help})
    EXPECT_EQ(ladder.after(Trouble::stalled), expected);
  EXPECT_EQ(ladder.tried(), 7);
}

TEST(RecoveryLadder, SkipsWhatCannotHelp) {
  EXPECT_EQ(RecoveryLadder().after(Trouble::failed), Rung::reopen);
  EXPECT_EQ(RecoveryLadder().after(Trouble::not_ready), Rung::reboot);
}

TEST(RecoveryLadder, GivesADeviceThatCameBackAFreshChance) {
  RecoveryLadder ladder;
  for (int i = 0; i < 5; ++i) (void)ladder.after(Trouble::stalled);
  EXPECT_EQ(ladder.after(Trouble::vanished), Rung::reopen);
  EXPECT_EQ(ladder.after(Trouble::vanished), Rung::reopen);
  EXPECT_EQ(ladder.after(Trouble::failed), Rung::reboot);
}

TEST(RecoveryLadder, ForgetsOnlyAfterAHundredGoodFrames) {
  RecoveryLadder ladder;
  (void)ladder.after(Trouble::stalled);
  for (int i = 0; i < 99; ++i) ladder.delivered();
  EXPECT_EQ(ladder.after(Trouble::stalled), Rung::reopen);
  for (int i = 0; i < 100; ++i) ladder.delivered();
  EXPECT_EQ(ladder.tried(), 0);
  EXPECT_EQ(ladder.after(Trouble::stalled), Rung::restart_stream);
}

TEST(ResetGate, LetsOneThroughAndThenWaits) {
  ResetGate gate(1s);
  const hal::MonotonicTime start(10s);
  EXPECT_TRUE(gate.enter(start));
  EXPECT_FALSE(gate.enter(start));
  EXPECT_FALSE(gate.enter(start + 999ms));
  EXPECT_TRUE(gate.enter(start + 1s));
}

}  // namespace
}  // namespace booth::drivers::kinect2
