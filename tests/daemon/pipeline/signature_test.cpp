// The fit gives the bits that are checked in, on every run and for any number of threads.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <fstream>

#include "daemon/pipeline/fit_signature.hpp"

namespace booth::daemon {
namespace {

// One for each architecture: Eigen fuses multiply-adds on Arm and not on x86, so that the bits are others there.
#if defined(__x86_64__)
constexpr const char* kCommitted = BOOTH_SOURCE_DIR "/tests/golden/signature.txt";
#else
constexpr const char* kCommitted = BOOTH_SOURCE_DIR "/tests/golden/signature-aarch64.txt";
#endif

TEST(FitSignature, IsTheCommittedOne) {
  std::ifstream file(kCommitted);
  std::string expected;
  file >> expected;
  ASSERT_EQ(expected.size(), 16u) << kCommitted << " is missing";
  EXPECT_EQ(golden_signature(2, kGoldenFrames), expected)
      << "the fit has changed. If that is what you want, put the new value there (boothctl bench signature) and say so in the commit";
}

TEST(FitSignature, DoesNotDependOnThreads) {
  constexpr int kFrames = 8;
  const std::string one = golden_signature(1, kFrames);
  EXPECT_EQ(golden_signature(3, kFrames), one);
}

TEST(FitSignature, DoesNotDependOnTheProcessorsCaches) {
  // What Eigen assumes where it does not ask: the sizes by which it cuts products into blocks, and so the order of their sums.
#if defined(__x86_64__)
  constexpr int kL1 = 32, kL2 = 256, kL3 = 2048;
#else
  constexpr int kL1 = 16, kL2 = 512, kL3 = 512;
#endif
  EXPECT_EQ(Eigen::l1CacheSize(), kL1 * 1024);
  EXPECT_EQ(Eigen::l2CacheSize(), kL2 * 1024);
  EXPECT_EQ(Eigen::l3CacheSize(), kL3 * 1024);
}

TEST(FitSignature, SeesASingleBit) {
  FrameRecord frame;
  frame.person = PersonState::tracked;
  frame.shape_count = 3;
  FitSignature a, b, c;
  a.add(frame);
  frame.q[35] = 1e-300;
  b.add(frame);
  frame.q[35] = 0;
  frame.beta[2] = 1e-300;
  c.add(frame);
  EXPECT_NE(a.text(), b.text());
  EXPECT_NE(a.text(), c.text());
}

}  // namespace
}  // namespace booth::daemon
