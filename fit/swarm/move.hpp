// How a particle of the swarm starts and moves: single-source, so that every back-end makes the same swarm from the same seed.
#pragma once

#include <cstdint>

#include "fit/gpu/host_device.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit {

/// The key of a frame's random numbers: those of fit/swarm/random.hpp's Random(seed, frame).
struct RandomKey {
  std::uint64_t seed = 1, frame = 0;
};

/// Philox4x32-10 of (frame, particle, dimension, draw): the words of Random::words(), one particle a lane.
template <class L>
BOOTH_HOST_DEVICE void random_words(const RandomKey& key, typename L::U particle, std::uint32_t dimension, std::uint32_t draw, typename L::U (&words)[4]) {
  typename L::U c0 = L::splat(static_cast<std::uint32_t>(key.frame)), c1 = L::splat(static_cast<std::uint32_t>(key.frame >> 32)), c2 = particle;
  typename L::U c3 = L::splat((dimension << 16) | (draw & 0xFFFFu));
  std::uint32_t k0 = static_cast<std::uint32_t>(key.seed), k1 = static_cast<std::uint32_t>(key.seed >> 32);
  for (int round = 0; round < 10; ++round) {
    typename L::U a_high, a_low, b_high, b_low;
    L::multiply_wide(c0, 0xD2511F53u, a_high, a_low);
    L::multiply_wide(c2, 0xCD9E8D57u, b_high, b_low);
    c0 = b_high ^ c1 ^ L::splat(k0);
    c1 = b_low;
    c2 = a_high ^ c3 ^ L::splat(k1);
    c3 = a_low;
    k0 += 0x9E3779B9u;
    k1 += 0xBB67AE85u;
  }
  words[0] = c0, words[1] = c1, words[2] = c2, words[3] = c3;
}

/// In [0, 1).
template <class L>
BOOTH_HOST_DEVICE typename L::F uniform(typename L::U word) {
  return L::unsigned_to_float(word >> 8) * 0x1p-24f;
}

/// So many dimensions share the words of one draw: Philox is the dearest part of a move.
inline constexpr std::uint32_t kDrawnTogether = 4;

/// Of a particle's dimensions from kDrawnTogether * block on: for each a word, for the move of this iteration (iteration 0: for the first velocity).
template <class L>
BOOTH_HOST_DEVICE void move_words(const RandomKey& key, int iteration, typename L::U particle, std::uint32_t block, typename L::U (&words)[kDrawnTogether]) {
  random_words<L>(key, particle, block, static_cast<std::uint32_t>(iteration + 1), words);
}

/// Random::low() and high(): each half of a word is a number of its own in [0, 1), in steps of 2^-16.
template <class L>
BOOTH_HOST_DEVICE typename L::F uniform_low(typename L::U word) {
  return L::unsigned_to_float(word & 0xFFFFu) * 0x1p-16f;
}
template <class L>
BOOTH_HOST_DEVICE typename L::F uniform_high(typename L::U word) {
  return L::unsigned_to_float(word >> 16) * 0x1p-16f;
}

/// Random::normal(): the sum of twelve 10-bit uniforms less six.
template <class L>
BOOTH_HOST_DEVICE typename L::F normal(const typename L::U (&words)[4]) {
  typename L::U sum = L::splat(std::uint32_t{0});
  for (int i = 0; i < 4; ++i) sum += (words[i] & 1023u) + ((words[i] >> 10) & 1023u) + ((words[i] >> 20) & 1023u);
  return (L::unsigned_to_float(sum) - 12 * 511.5f) * (1.0f / 1024.0f);
}

/// What the move of one iteration needs besides the particle.
struct MoveStep {
  RandomKey key;
  int iteration = 0;
  int starts = 1;
  float inertia = 0, cognitive = 0, social = 0;
};

/// Inertia of an iteration: linear from first to last.
BOOTH_HOST_DEVICE float inertia_of(int iteration, int iterations, float first, float last) {
  const float progress = iterations > 1 ? static_cast<float>(iteration) / static_cast<float>(iterations - 1) : 1.0f;
  return first + (last - first) * progress;
}

/// Iteration 0, one dimension: normal about the centre, the first particle of each centre on it; a velocity within half a deviation. `word` is the
/// dimension's of move_words().
template <class L>
BOOTH_HOST_DEVICE void start_dimension(const MoveStep& step, typename L::U particle, std::uint32_t dimension, typename L::U word, typename L::F centre,
                                       float deviation, typename L::F& x, typename L::F& v) {
  typename L::U words[4];
  random_words<L>(step.key, particle, dimension, 0, words);
  const typename L::F away = normal<L>(words) * deviation;
  x = centre + ((particle < L::splat(static_cast<std::uint32_t>(step.starts))) ? L::splat(0.0f) : away);
  v = (uniform<L>(word) * 2.0f - 1.0f) * (0.5f * deviation);
}

/// Later iterations, one dimension: inertia, the pull to the particle's own best and to the swarm's, the clamp at half a deviation. `word` is the
/// dimension's of move_words(): each pull takes a half of it.
template <class L>
BOOTH_HOST_DEVICE void move_dimension(const MoveStep& step, typename L::U word, typename L::F own, float global, float deviation, typename L::F& x,
                                      typename L::F& v) {
  const float limit = 0.5f * deviation;
  typename L::F speed = v * step.inertia + uniform_low<L>(word) * step.cognitive * (own - x) + uniform_high<L>(word) * step.social * (L::splat(global) - x);
  speed = speed < L::splat(-limit) ? L::splat(-limit) : speed;
  speed = speed > L::splat(limit) ? L::splat(limit) : speed;
  v = speed;
  x = x + speed;
}

}  // namespace booth::fit
