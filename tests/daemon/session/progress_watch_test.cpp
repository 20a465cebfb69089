// A thread that does not move is found after the patience, not before.
#include <gtest/gtest.h>

#include "daemon/health/progress_watch.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;

TEST(ProgressWatch, FindsTheOneThatHangs) {
  ProgressWatch watch(10s);
  std::uint64_t moving = 0;
  for (auto t = 0s; t <= 10s; t += 1s) EXPECT_EQ(watch.stalled({++moving, 7, ++moving}, t), -1) << t.count();
  EXPECT_EQ(watch.stalled({++moving, 7, ++moving}, 11s), 1);
  EXPECT_EQ(watch.stalled({++moving, 8, ++moving}, 12s), -1) << "it moves again";
}

TEST(ProgressWatch, ACameraThatEndsIsNotAHungThread) {
  ProgressWatch watch(10s);
  EXPECT_EQ(watch.stalled({1, 2, 3}, 0s), -1);
  EXPECT_EQ(watch.stalled({1, 2}, 20s), -1);
  EXPECT_EQ(watch.stalled({1, 3}, 31s), 0);
}

}  // namespace
}  // namespace booth::daemon
