// The newest value between two threads: never torn, never older than the last, lost only to a newer one.
#include "daemon/dds/ros2/latest_value.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>

namespace booth::daemon {
namespace {

TEST(LatestValue, IsTheNewestAndIsTakenOnce) {
  LatestValue<int> value;
  EXPECT_EQ(value.take(), nullptr);
  value.draft() = 1;
  EXPECT_TRUE(value.submit());
  value.draft() = 2;
  EXPECT_FALSE(value.submit()) << "1 was not taken";
  const int* taken = value.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 2);
  EXPECT_EQ(value.take(), nullptr);
  value.draft() = 3;
  EXPECT_TRUE(value.submit());
  EXPECT_EQ(*taken, 2) << "what the reader looks at is not written to";
}

TEST(LatestValue, IsNeverTorn) {
  constexpr std::uint64_t kValues = 200'000;
  LatestValue<std::array<std::uint64_t, 32>> value;
  std::uint64_t lost = 0, seen = 0, last = 0;
  std::thread writer([&] {
    for (std::uint64_t n = 1; n <= kValues; ++n) {
      value.draft().fill(n);
      lost += !value.submit();
    }
  });
  while (last != kValues) {
    const auto* taken = value.take();
    if (taken == nullptr) continue;
    for (const std::uint64_t v : *taken) ASSERT_EQ(v, taken->front());
    ASSERT_GT(taken->front(), last);
    last = taken->front();
    ++seen;
  }
  writer.join();
  EXPECT_EQ(seen + lost, kValues);
}

}  // namespace
}  // namespace booth::daemon
