// A small kernel on the emulated device: rounds, phases and barriers; and that a race or a read before the first write shows.
#include <gtest/gtest.h>

#include <vector>

#include "fit/gpu/emulated_device.hpp"

namespace booth::gpu {
namespace {

/// Sums of eight numbers each; with kRace, threads read what others write in the same phase.
template <bool kRace>
struct SumEights : OneRound {
  static constexpr int kThreads = 8, kPhases = 2;
  struct Shared {
    int value[kThreads];
  };
  struct Private {};
  const int* from = nullptr;
  int* to = nullptr;

  int rounds(const Lane&) const { return 1; }
  template <int kPhase>
  void phase(const Lane& lane, int, Shared& s, Private&) const {
    if constexpr (kPhase == 0) {
      s.value[lane.thread] = from[lane.block * kThreads + lane.thread];
      if (kRace && lane.thread > 0) s.value[lane.thread] += s.value[lane.thread - 1];
    } else if (lane.thread == 0) {
      int sum = 0;
      for (int v : s.value) sum += v;
      to[lane.block] = kRace ? s.value[kThreads - 1] : sum;
    }
  }
};
struct Kernels {
  using Any = std::variant<SumEights<false>, SumEights<true>>;
};

template <bool kRace>
std::vector<int> sums(Order order) {
  Faults faults;
  faults.order = order;
  EmulatedDevice<Kernels> device(faults, 4);
  int *in = nullptr, *out = nullptr, program = -1;
  EXPECT_EQ(allocate(device, 24, in), DeviceError::none);
  EXPECT_EQ(allocate(device, 3, out), DeviceError::none);
  std::vector<int> numbers(24);
  for (int i = 0; i < 24; ++i) numbers[static_cast<std::size_t>(i)] = i;
  EXPECT_EQ(device.upload(in, numbers.data(), numbers.size() * sizeof(int)), DeviceError::none);
  SumEights<kRace> kernel;
  kernel.from = in, kernel.to = out;
  const Step<Kernels> step{kernel, 3};
  EXPECT_EQ(device.record({&step, 1}, program), DeviceError::none);
  EXPECT_EQ(device.run(program), DeviceError::none);
  return {out, out + 3};
}

TEST(EmulatedDevice, RunsEveryThreadOfEveryBlock) {
  EXPECT_EQ(sums<false>(Order::forwards), (std::vector<int>{28, 92, 156}));
  EXPECT_EQ(sums<false>(Order::backwards), (std::vector<int>{28, 92, 156}));
}

TEST(EmulatedDevice, ShowsARaceAsADifferenceBetweenTheTwoOrders) { EXPECT_NE(sums<true>(Order::forwards), sums<true>(Order::backwards)); }

TEST(EmulatedDevice, FailsAsItIsTold) {
  Faults faults;
  faults.allocations_left = 1;
  EmulatedDevice<Kernels> device(faults, 1);
  int* memory = nullptr;
  EXPECT_EQ(allocate(device, 1, memory), DeviceError::none);
  EXPECT_EQ(allocate(device, 1, memory), DeviceError::out_of_memory);
  EXPECT_NE(device.problem().find("out of device memory"), std::string::npos);
}

}  // namespace
}  // namespace booth::gpu
