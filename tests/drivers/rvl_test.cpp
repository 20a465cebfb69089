// Packed depth images: the same bits again for anything, the published layout, and no harm from bytes that are none.
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "drivers/recording/rvl.hpp"

namespace booth::drivers {
namespace {

std::vector<std::byte> packed(const std::vector<std::uint16_t>& depth) {
  std::vector<std::byte> out(rvl_bound(depth.size()));
  out.resize(rvl_pack(depth, out.data()));
  return out;
}

void expect_round_trip(const std::vector<std::uint16_t>& depth, const char* what) {
  const auto bytes = packed(depth);
  EXPECT_LE(bytes.size(), rvl_bound(depth.size())) << what;
  std::vector<std::uint16_t> again(depth.size(), 7);
  ASSERT_TRUE(rvl_unpack(bytes, again)) << what;
  EXPECT_EQ(again, depth) << what;
}

TEST(Rvl, GivesTheSameBitsAgain) {
  std::mt19937 random(5);
  std::vector<std::uint16_t> depth(512 * 424);
  expect_round_trip({}, "nothing");
  expect_round_trip(std::vector<std::uint16_t>(1000, 0), "zeros");
  expect_round_trip(std::vector<std::uint16_t>(1000, 65535), "the farthest");
  for (auto& d : depth) d = static_cast<std::uint16_t>(random());
  expect_round_trip(depth, "noise");
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = i % 2 ? 65535 : 1;
  expect_round_trip(depth, "the greatest differences");
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = i % 2 ? 65535 : 0;
  expect_round_trip(depth, "the shortest runs");
  for (int length = 1; length < 200; ++length) {
    std::vector<std::uint16_t> some(static_cast<std::size_t>(length));
    for (auto& d : some) d = random() % 3 ? static_cast<std::uint16_t>(1000 + random() % 40) : std::uint16_t{0};
    expect_round_trip(some, "a short one");
  }
}

TEST(Rvl, IsLaidOutAsPublished) {
  // No zeros, three others: 1000 (zigzag 2000: nibbles 8|0, 8|2, 8|7, 3), then +1 (zigzag 2), then -2 (zigzag 3).
  const auto bytes = packed({1000, 1001, 999});
  ASSERT_EQ(bytes.size(), 4u);
  std::uint32_t word;
  std::memcpy(&word, bytes.data(), 4);
  EXPECT_EQ(word, 0x038af323u);
}

TEST(Rvl, RefusesWhatIsNoImage) {
  std::mt19937 random(6);
  std::vector<std::uint16_t> depth(300);
  for (auto& d : depth) d = random() % 4 ? static_cast<std::uint16_t>(2000 + random() % 9) : std::uint16_t{0};
  const auto good = packed(depth);
  std::vector<std::uint16_t> again(depth.size());
  for (std::size_t n = 0; n + 4 <= good.size(); ++n) EXPECT_FALSE(rvl_unpack(std::span(good).first(n), again)) << n;
  std::vector<std::uint16_t> fewer(depth.size() - 1);
  EXPECT_FALSE(rvl_unpack(good, fewer)) << "an image of another size";
  for (int turn = 0; turn < 2000; ++turn) {
    std::vector<std::byte> garbage(random() % 200);
    for (auto& b : garbage) b = static_cast<std::byte>(random());
    (void)rvl_unpack(garbage, again);  // the sanitizers look on
  }
  const std::vector<std::byte> endless(64, std::byte{0xff});
  EXPECT_FALSE(rvl_unpack(endless, again)) << "a number without an end";
}

}  // namespace
}  // namespace booth::drivers
