// Philox against the published known answers, and the shape of what is made from it.
#include "fit/swarm/random.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace booth::fit {
namespace {

// Known-answer vectors of Random123 for philox4x32-10.
TEST(Philox, KnownAnswers) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (std::array<std::uint32_t, 4>{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t f = 0xffffffff;
  EXPECT_EQ(philox({f, f, f, f}, {f, f}), (std::array<std::uint32_t, 4>{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
}

TEST(Random, EveryKeyPartMatters) {
  const Random a(1, 2);
  EXPECT_EQ(a.words(3, 4, 5), Random(1, 2).words(3, 4, 5));
  EXPECT_NE(a.words(3, 4, 5), Random(9, 2).words(3, 4, 5));
  EXPECT_NE(a.words(3, 4, 5), Random(1, 9).words(3, 4, 5));
  EXPECT_NE(a.words(3, 4, 5), a.words(9, 4, 5));
  EXPECT_NE(a.words(3, 4, 5), a.words(3, 9, 5));
  EXPECT_NE(a.words(3, 4, 5), a.words(3, 4, 9));
}

TEST(Random, NormalHasUnitVarianceAndUniformStaysBelowOne) {
  constexpr int n = 40000;
  double sum = 0, squares = 0;
  for (int i = 0; i < n; ++i) {
    const auto w = Random(11, 0).words(static_cast<std::uint32_t>(i), 0, 0);
    const double x = static_cast<double>(Random::normal(w));
    sum += x, squares += x * x;
    ASSERT_GE(Random::uniform(w[0]), 0.0f);
    ASSERT_LT(Random::uniform(w[0]), 1.0f);
  }
  EXPECT_NEAR(sum / n, 0, 4 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 1, 0.03);
  EXPECT_LT(Random::uniform(0xffffffff), 1.0f);
  EXPECT_LT(Random::low(0xffffffff), 1.0f);
  EXPECT_LT(Random::high(0xffffffff), 1.0f);
}

// A move takes two numbers from the halves of one word, and four dimensions the words of one draw: neither may know of the other.
TEST(Random, TheHalvesOfAWordAndTheWordsOfADrawAreUniformAndIndependent) {
  constexpr int n = 40000;
  double mean[8] = {}, product[8][8] = {};
  for (int i = 0; i < n; ++i) {
    const auto w = Random(12, 0).words(static_cast<std::uint32_t>(i), 3, 2);
    double u[8];
    for (std::size_t k = 0; k < 8; ++k) u[k] = static_cast<double>(k % 2 ? Random::high(w[k / 2]) : Random::low(w[k / 2])) - 0.5;
    for (int a = 0; a < 8; ++a) {
      mean[a] += u[a] / n;
      for (int b = 0; b < 8; ++b) product[a][b] += u[a] * u[b] / n;
    }
  }
  const double deviation = 1 / std::sqrt(12.0 * n);
  for (int a = 0; a < 8; ++a) {
    EXPECT_NEAR(mean[a], 0, 4.5 * deviation) << a;
    EXPECT_NEAR(product[a][a], 1.0 / 12, 0.002) << a;
    for (int b = 0; b < a; ++b) EXPECT_NEAR(product[a][b], 0, 4.5 / 12 / std::sqrt(n)) << a << " " << b;
  }
}

}  // namespace
}  // namespace booth::fit
