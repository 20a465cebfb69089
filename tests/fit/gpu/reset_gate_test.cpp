// Several users of one device: who lost it resets it once, the others find out, and nobody is reset in the middle of a call.
#include "fit/gpu/reset_gate.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace booth::gpu {
namespace {

TEST(ResetGate, ResetsOnceForEveryGenerationThatWasLost) {
  ResetGate gate;
  int resets = 0;
  const auto open = [&] { return gate.open([&] { ++resets; }); };
  const auto first = open(), second = open();
  EXPECT_EQ(first, second);
  EXPECT_EQ(resets, 0);
  EXPECT_TRUE(ResetGate::Hold(gate, second));
  gate.lose(first);
  EXPECT_TRUE(ResetGate::Hold(gate, second)) << "nobody has reset anything yet";
  const auto third = open();
  EXPECT_EQ(resets, 1);
  EXPECT_FALSE(ResetGate::Hold(gate, second)) << "its memory went with the reset";
  EXPECT_TRUE(ResetGate::Hold(gate, third));
  // The others lose their devices late: no reason to reset the new ones.
  gate.lose(second);
  EXPECT_EQ(open(), third);
  EXPECT_EQ(resets, 1);
}

TEST(ResetGate, WaitsForThoseWhoHoldOn) {
  ResetGate gate;
  std::atomic<std::uint64_t> newest{gate.open([] {})};
  std::atomic<bool> stop{false}, resetting{false};
  std::atomic<int> calls{0}, torn{0};
  std::vector<std::thread> users;
  for (int i = 0; i < 3; ++i)
    users.emplace_back([&] {
      while (!stop) {
        const ResetGate::Hold hold(gate, newest);
        if (hold && resetting) ++torn;
        ++calls;
        std::this_thread::yield();
      }
    });
  for (int i = 0; i < 20; ++i) {
    const int before = calls;
    while (calls < before + 3) std::this_thread::yield();
    gate.lose(newest);
    newest = gate.open([&] {
      resetting = true;
      std::this_thread::yield();
      resetting = false;
    });
  }
  stop = true;
  for (auto& user : users) user.join();
  EXPECT_EQ(torn, 0);
}

}  // namespace
}  // namespace booth::gpu
