// What a kernel is, so that one source runs on a graphics processor and, block by block and thread by thread, in ordinary tests.
#pragma once

#include <cstddef>
#include <cstdint>

#include "fit/gpu/host_device.hpp"

namespace booth::gpu {

/// Who is running: thread `thread` of K::kThreads in block `block` of `blocks`.
///
/// A kernel K is a struct of plain values and device pointers with
///   static constexpr int kThreads, kPhases;
///   struct Shared;   the block's memory, not initialised
///   struct Private;  what a thread keeps from phase to phase
///   int rounds(const Lane&) const;   how often the phases run; the same for all threads of a block
///   template <int kPhase> bool runs(int round) const;   whether a round has the phase at all
///   template <int kPhase> void phase(const Lane&, int round, Shared&, Private&) const;
/// Between two phases (and after the last, before the next round) all threads of a block meet. Within a phase no thread may read what another one writes.
struct Lane {
  int block, blocks, thread;
};

/// What kernels share that run all their phases, once.
struct OneRound {
  BOOTH_HOST_DEVICE int rounds(const Lane&) const { return 1; }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int) const {
    return true;
  }
};

/// The order in which the emulator takes the threads of a phase, and the blocks of a launch. A kernel without races does not see the difference.
enum class Order : std::uint8_t { forwards, backwards };

namespace detail {

template <class K, int kPhase>
void emulate_phase(const K& kernel, int block, int blocks, int round, typename K::Shared& shared, typename K::Private* own, Order order) {
  for (int t = 0; t < K::kThreads && kernel.template runs<kPhase>(round); ++t) {
    const int thread = order == Order::forwards ? t : K::kThreads - 1 - t;
    kernel.template phase<kPhase>(Lane{block, blocks, thread}, round, shared, own[thread]);
  }
  if constexpr (kPhase + 1 < K::kPhases) emulate_phase<K, kPhase + 1>(kernel, block, blocks, round, shared, own, order);
}

}  // namespace detail

/// A launch on the host. `shared` and `own` (K::kThreads of them) are the caller's, so that nothing is allocated here. What a block leaves in them is void.
template <class K>
void emulate(const K& kernel, int blocks, typename K::Shared& shared, typename K::Private* own, Order order = Order::forwards) {
  for (int b = 0; b < blocks; ++b) {
    const int block = order == Order::forwards ? b : blocks - 1 - b;
    // Shared memory holds what was there before: bytes that are neither zeros nor any number, so that whoever reads first and writes then is found out.
    unsigned char* bytes = reinterpret_cast<unsigned char*>(&shared);
    for (std::size_t i = 0; i < sizeof shared; ++i) bytes[i] = 0xFF;
    const int rounds = kernel.rounds(Lane{block, blocks, 0});
    for (int round = 0; round < rounds; ++round) detail::emulate_phase<K, 0>(kernel, block, blocks, round, shared, own, order);
  }
}

}  // namespace booth::gpu
