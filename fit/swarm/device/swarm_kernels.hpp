// One iteration of the swarm on a device: a block takes a few particles through move, energy and keeping of the best; a thread of it, every 512th vertex.
#pragma once

#include <float.h>

#include <cstdint>

#include "fit/energy/particle_energy.hpp"
#include "fit/energy/pose_steps.hpp"
#include "fit/gpu/host_device.hpp"
#include "fit/gpu/launch.hpp"
#include "fit/swarm/device/point_kernels.hpp"
#include "fit/swarm/move.hpp"

namespace booth::fit::device {

inline constexpr int kMostPairs = 8;  ///< so many coefficient pairs a particle may have here
inline constexpr int kMostDimensions = kParticleDofs + 2 * kMostPairs;
inline constexpr int kMostIterations = 256;
inline constexpr int kMostStarts = 64;
inline constexpr int kLevels = 5;  ///< of the kinematic chain, the root's included
inline constexpr int kMostPoseComponents = 30;

/// Several particles side by side, for what they share with a vertex: the shape's words are loaded once for all of them.
template <int kCount_>
struct ParticleLanes {
  static constexpr int kCount = kCount_;
  struct F {
    float v[kCount];
  };
  struct I {
    std::int32_t v[kCount];
  };
  BOOTH_HOST_DEVICE static I splat(std::int32_t x) {
    I out;
    for (int i = 0; i < kCount; ++i) out.v[i] = x;
    return out;
  }
  BOOTH_HOST_DEVICE static F to_float(const I& x) {
    F out;
    for (int i = 0; i < kCount; ++i) out.v[i] = ScalarLanes::to_float(x.v[i]);
    return out;
  }
  BOOTH_HOST_DEVICE static I pair_dot(I sum, const I& a, const I& b) {
    for (int i = 0; i < kCount; ++i) sum.v[i] = ScalarLanes::pair_dot(sum.v[i], a.v[i], b.v[i]);
    return sum;
  }
};

/// What changes from frame to frame; pinned.
struct alignas(16) SwarmFrame {
  RandomKey key;
  std::int32_t starts = 1;
  float deviation[kMostDimensions];
  float centres[kMostStarts * kMostDimensions];
};

/// The best particle; pinned. `done` is written with the rest, as a mark that the kernels ran.
struct SwarmAnswer {
  float best[kMostDimensions];
  float cost;
  ParticleTerms terms;
  float history[kMostIterations];
  std::uint64_t done;
};

/// What the swarm takes from iteration to iteration; device memory. Two of most things: one launch reads what the launch before has written.
struct SwarmState {
  const SwarmFrame* frame;            ///< the device's own copy
  float *position, *velocity, *best;  ///< [particle][dimension]
  float* best_cost;                   ///< [particle]
  std::uint64_t* block_key[2];        ///< [block]: cost's bits and index of the block's best particle, in one number that compares like both
  float* block_best[2];               ///< [block][kMostDimensions]
  float* global[2];                   ///< cost, then the vector
  float* history;                     ///< [iteration]
};

/// Copies a frame's settings from pinned memory, where no TakeCloud does, so that they cross the bus once; all at once, since each trip over it takes
/// microseconds.
struct TakeFrame : OneRound {
  static constexpr int kThreads = 1024, kPhases = 1;
  struct Shared {};
  struct Private {};
  static constexpr int kWords = static_cast<int>(sizeof(SwarmFrame) / sizeof(Words));
  const SwarmFrame* from = nullptr;
  SwarmFrame* to = nullptr;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    static_assert(sizeof(SwarmFrame) % sizeof(Words) == 0);
    for (int i = lane.thread; i < kWords; i += kThreads) reinterpret_cast<Words*>(to)[i] = reinterpret_cast<const Words*>(from)[i];
  }
};

/// Iterations 0, 1, ...: moves and evaluates kParticles particles a block. With `answer`, one block more: finds the swarm's best after the last
/// iteration (or takes `given`), evaluates it, writes all that the host wants to know.
template <int kParticles, int kChunk>
struct Iterate {
  static constexpr int kThreads = 512, kPhases = 16, kWarp = 32;
  static constexpr int kVertexBatches = kThreads / kBatch;
  using Lanes = ParticleLanes<kChunk>;

  struct Shared {
    alignas(16) float transform[kParticles][kParts][12];
    alignas(16) typename Lanes::I pair[kParticles / kChunk][kMostPairs];
    float particle[kParticles][kMostDimensions];
    float shape[kParticles], bone[kParticles], pose[kParticles];
    float sum[kParticles][2];
    float cost[kParticles];
    std::int32_t better[kParticles], winner;
    union {
      struct {
        std::uint64_t key[kThreads], row[kWarp];
        float joint[kParticles][kPartJoints * 3];
        float sine[kParticles][kParticleDofs], cosine[kParticles][kParticleDofs];
        float component[kParticles][kMostPoseComponents], all[kParticles];
      } before;
      struct {
        float value[kChunk][2][kThreads + kVertexBatches];  ///< a gap after each batch, against bank conflicts
        float batch[kChunk][2][kVertexBatches + 1];
      } vertices;
    };
  };
  struct Private {};

  EnergyView m;
  const BrickView* field = nullptr;
  const std::int32_t* vertex_segment = nullptr;  ///< [vertex]: index in m.segment
  std::int8_t level_part[kParts];                ///< parts by level ...
  std::int8_t level_start[kLevels + 1];          ///< ... and where each level begins
  SwarmState state;
  std::int32_t particles = 0, iteration = 0;
  std::int32_t block_particles = kParticles;  ///< of the iterations' blocks
  float inertia = 0, cognitive = 0, social = 0;
  SwarmAnswer* answer = nullptr;
  const float* given = nullptr;

  BOOTH_HOST_DEVICE int vertex_rounds() const { return (m.batches + kVertexBatches - 1) / kVertexBatches; }
  BOOTH_HOST_DEVICE int rounds(const Lane&) const { return vertex_rounds() * (kParticles / kChunk); }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int round) const {
    return kPhase < 10 ? round == 0 : kPhase < 12 ? true : round == vertex_rounds() * (kParticles / kChunk) - 1;
  }
  /// Of the particles before this launch's.
  BOOTH_HOST_DEVICE bool has_past() const { return iteration > 0 && given == nullptr; }

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const int t = lane.thread;
    if constexpr (kPhase == 0) {
      gather_keys(t, s);
    } else if constexpr (kPhase == 1) {
      if (t >= kWarp || !has_past()) return;
      std::uint64_t least = s.before.key[t];
      for (int i = t; i < kThreads; i += kWarp) least = s.before.key[i] < least ? s.before.key[i] : least;
      s.before.row[t] = least;
    } else if constexpr (kPhase == 2) {
      move(lane, s);
    } else if constexpr (kPhase == 3) {
      prepare(t, s);
    } else if constexpr (kPhase == 4) {
      for (int i = t; i < 3 * kParticles; i += kThreads) {
        const int p = i % kParticles;
        if (i < kParticles)
          place(p, 0, s);
        else if (i < 2 * kParticles)
          s.bone[p] = bone_term<ScalarLanes>(s.before.joint[p]);
        else
          s.pose[p] = pose_term<ScalarLanes>(s.before.all[p], s.before.component[p], m.pose_components, 1);
      }
    } else if constexpr (kPhase < 9) {
      constexpr int kLevel = kPhase - 4;
      const int first = level_start[kLevel], count = level_start[kLevel + 1] - first;
      for (int i = t; i < kParticles * count; i += kThreads) place(i / count, level_part[first + i % count], s);
    } else if constexpr (kPhase == 9) {
      const BrickView f = *field;
      for (int i = t; i < kParticles * kParts; i += kThreads) to_cells<ScalarLanes>(m, f, s.transform[i / kParts][i % kParts]);
      for (int i = t; i < 2 * kParticles; i += kThreads) s.sum[i / 2][i % 2] = 0;
    } else if constexpr (kPhase == 10) {
      if (round > 0) add_batches(t, round - 1, s);
      evaluate(t, round, s);
    } else if constexpr (kPhase == 11) {
      for (int i = t; i < kChunk * 2 * kVertexBatches; i += kThreads) {
        const int c = i / (2 * kVertexBatches), term = i / kVertexBatches % 2, b = i % kVertexBatches;
        if (round / (kParticles / kChunk) * kVertexBatches + b >= m.batches) continue;
        float sum = 0;
        for (int k = 0; k < kBatch; ++k) sum = sum + s.vertices.value[c][term][b * (kBatch + 1) + k];
        s.vertices.batch[c][term][b] = sum;
      }
    } else if constexpr (kPhase == 12) {
      add_batches(t, round, s);
    } else if constexpr (kPhase == 13) {
      for (int p = t; p < kParticles; p += kThreads) judge(lane, p, s);
    } else if constexpr (kPhase == 14) {
      keep(lane, s);
    } else {
      if (answer == nullptr && t < m.dimensions() && s.winner >= 0)
        state.block_best[iteration & 1][lane.block * kMostDimensions + t] = state.best[static_cast<std::int64_t>(s.winner) * m.dimensions() + t];
    }
  }

 private:
  BOOTH_HOST_DEVICE static float cost_of(std::uint64_t key) { return ScalarLanes::as_float(static_cast<std::int32_t>(key >> 32)); }

  BOOTH_HOST_DEVICE void gather_keys(int t, Shared& s) const {
    if (!has_past()) return;
    const std::uint64_t* keys = state.block_key[(iteration - 1) & 1];
    const int blocks = (particles + block_particles - 1) / block_particles;
    std::uint64_t least = ~std::uint64_t{0};
    for (int b = t; b < blocks; b += kThreads) least = keys[b] < least ? keys[b] : least;
    s.before.key[t] = least;
  }

  /// The swarm's best so far is found by every block for itself; then each moves its particles.
  BOOTH_HOST_DEVICE void move(const Lane& lane, Shared& s) const {
    const int d = m.dimensions(), t = lane.thread;
    const float* old = state.global[(iteration - 1) & 1];
    const float* best = old + 1;
    float cost = FLT_MAX;
    if (has_past()) {
      std::uint64_t key = s.before.row[0];
      for (int i = 1; i < kWarp; ++i) key = s.before.row[i] < key ? s.before.row[i] : key;
      if (iteration > 1) cost = old[0];
      if (cost_of(key) < cost) {
        cost = cost_of(key);
        best = state.block_best[(iteration - 1) & 1] + static_cast<std::int32_t>(static_cast<std::uint32_t>(key)) / block_particles * kMostDimensions;
      }
      if (lane.block == 0) {
        float* now = state.global[iteration & 1];
        if (t < d) now[1 + t] = best[t];
        if (t == 0) now[0] = cost, state.history[iteration - 1] = cost;
      }
    }
    if (answer != nullptr) {
      const float* from = given != nullptr ? given : best;
      for (int i = t; i < kParticles * d; i += kThreads) s.particle[i / d][i % d] = from[i % d];
      if (given == nullptr && t == 0) answer->cost = cost;
      return;
    }
    const SwarmFrame& frame = *state.frame;
    MoveStep step;
    step.key = frame.key, step.iteration = iteration, step.starts = frame.starts;
    step.inertia = inertia, step.cognitive = cognitive, step.social = social;
    for (int i = t; i < kParticles * d; i += kThreads) {
      const int p = i / d, k = i % d;
      const std::uint32_t particle = static_cast<std::uint32_t>(lane.block * kParticles + p);
      const std::int64_t at = static_cast<std::int64_t>(particle) * d + k;
      float x = 0, v = 0;
      if (particle >= static_cast<std::uint32_t>(particles)) {
        s.particle[p][k] = 0;
        continue;
      }
      const std::uint32_t dimension = static_cast<std::uint32_t>(k);
      std::uint32_t words[kDrawnTogether];
      move_words<ScalarLanes>(step.key, iteration, particle, dimension / kDrawnTogether, words);
      const std::uint32_t first = k & 1 ? words[1] : words[0], second = k & 1 ? words[3] : words[2], word = k & 2 ? second : first;
      if (iteration == 0) {
        const float centre = frame.centres[static_cast<int>(particle % static_cast<std::uint32_t>(frame.starts)) * d + k];
        start_dimension<ScalarLanes>(step, particle, dimension, word, centre, frame.deviation[k], x, v);
      } else {
        x = state.position[at], v = state.velocity[at];
        move_dimension<ScalarLanes>(step, word, state.best[at], best[k], frame.deviation[k], x, v);
      }
      state.position[at] = x, state.velocity[at] = v;
      s.particle[p][k] = x;
    }
  }

  /// All that needs the particle alone: joints, sines, the priors' sums, beta in fixed point. A thread takes one number.
  BOOTH_HOST_DEVICE void prepare(int t, Shared& s) const {
    using L = ScalarLanes;
    constexpr int kJoints = kPartJoints * 3;
    const auto away_of = [&](const float* particle) { return [this, particle](int a) { return angle_from_mean<L>(m, particle, 1, a); }; };
    for (int i = t; i < kParticles * kJoints; i += kThreads)
      s.before.joint[i / kJoints][i % kJoints] = rest_joint_coordinate<L>(m, s.particle[i / kJoints], 1, i % kJoints);
    for (int i = t; i < kParticles * kParticleDofs; i += kThreads) {
      const int p = i / kParticleDofs, k = i % kParticleDofs;
      if (k >= 3) sine_cosine<L>(s.particle[p][k], s.before.sine[p][k], s.before.cosine[p][k]);
    }
    for (int i = t; i < kParticles * m.pose_components; i += kThreads)
      s.before.component[i / m.pose_components][i % m.pose_components] =
          pose_component_square<L>(m, away_of(s.particle[i / m.pose_components]), i % m.pose_components);
    for (int i = t; i < 3 * kParticles; i += kThreads) {
      const int p = i % kParticles;
      if (i < kParticles) {
        s.before.all[p] = pose_square<L>(away_of(s.particle[p]));
      } else if (i < 2 * kParticles) {
        s.shape[p] = shape_term<L>(m, s.particle[p], 1);
      } else {
        std::int32_t pair[kMostPairs];
        pack_shape<L>(m, s.particle[p], 1, pair);
        for (int k = 0; k < m.pairs; ++k) s.pair[p / kChunk][k].v[p % kChunk] = pair[k];
      }
    }
  }

  BOOTH_HOST_DEVICE void place(int p, int part, Shared& s) const {
    const int parent = m.part[part].parent;
    const auto turn = [&](int dof, float& sine, float& cosine) { sine = s.before.sine[p][dof], cosine = s.before.cosine[p][dof]; };
    place_part<ScalarLanes>(m, part, s.before.joint[p], s.transform[p][parent < 0 ? 0 : parent], s.particle[p], turn, s.transform[p][part]);
  }

  /// A thread's vertex, for the kChunk particles whose turn it is.
  BOOTH_HOST_DEVICE void evaluate(int t, int round, Shared& s) const {
    constexpr int kChunks = kParticles / kChunk;
    const int batch = round / kChunks * kVertexBatches + t / kBatch, chunk = round % kChunks, lane = t % kBatch;
    if (batch >= m.batches) return;
    const std::int32_t* shape = m.shape + static_cast<std::int64_t>(batch) * m.batch_words() + lane;
    const float* weight = m.weight + static_cast<std::int64_t>(batch) * ((kVertexParts - 1) * kBatch) + lane;
    const Segment segment = m.segment[vertex_segment[batch * kBatch + lane]];
    const BrickView f = *field;
    typename Lanes::F rest[6];
    if (m.pairs == kMostPairs)
      rest_vertex<Lanes, kMostPairs>(shape, s.pair[chunk], m.pairs, rest);
    else
      rest_vertex<Lanes, 0>(shape, s.pair[chunk], m.pairs, rest);
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
    for (int c = 0; c < kChunk; ++c) {
      float blended[12], own[6], posed[6], point, plane;
      for (int i = 0; i < 6; ++i) own[i] = rest[i].v[c];
      blend_transforms<ScalarLanes>(s.transform[chunk * kChunk + c], segment, weight, blended);
      pose_vertex<ScalarLanes>(blended, own, posed);
      const bool outside = field_difference<ScalarLanes>(f, posed[0], posed[1], posed[2]);
      vertex_distances<ScalarLanes>(f, posed, outside, point, plane);
      s.vertices.value[c][0][t + t / kBatch] = point, s.vertices.value[c][1][t + t / kBatch] = plane;
    }
  }

  /// The batches of a round, one after the other, to their particles' sums.
  BOOTH_HOST_DEVICE void add_batches(int t, int round, Shared& s) const {
    constexpr int kChunks = kParticles / kChunk;
    if (t >= 2 * kChunk) return;
    const int c = t / 2, term = t % 2, first = round / kChunks * kVertexBatches, p = round % kChunks * kChunk + c;
    const int count = m.batches - first < kVertexBatches ? m.batches - first : kVertexBatches;
    float sum = s.sum[p][term];
    for (int b = 0; b < count; ++b) sum = sum + s.vertices.batch[c][term][b];
    s.sum[p][term] = sum;
  }

  BOOTH_HOST_DEVICE void judge(const Lane& lane, int p, Shared& s) const {
    const float scale = m.data_scale * field->cell_size;
    const ParticleTerms terms{s.sum[p][0] * scale, s.sum[p][1] * scale, s.shape[p], s.bone[p], s.pose[p]};
    const float cost = total_energy<ScalarLanes>(m, terms);
    if (answer != nullptr) {
      if (p == 0) answer->terms = terms;
      return;
    }
    const int particle = lane.block * kParticles + p;
    s.better[p] = 0, s.cost[p] = FLT_MAX;
    if (particle >= particles) return;
    const bool better = iteration == 0 || cost < state.best_cost[particle];
    s.better[p] = better ? 1 : 0;
    if (better) state.best_cost[particle] = cost;
    s.cost[p] = better ? cost : state.best_cost[particle];
  }

  BOOTH_HOST_DEVICE void keep(const Lane& lane, Shared& s) const {
    const int d = m.dimensions(), t = lane.thread;
    if (answer != nullptr) {
      for (int k = t; k < d && given == nullptr; k += kThreads) answer->best[k] = s.particle[0][k];
      for (int i = t; i < iteration && given == nullptr; i += kThreads) answer->history[i] = state.history[i];
      if (t == 0) answer->done = given == nullptr ? state.frame->key.frame : ~std::uint64_t{0};
      return;
    }
    for (int i = t; i < kParticles * d; i += kThreads)
      if (s.better[i / d]) state.best[static_cast<std::int64_t>(lane.block * kParticles + i / d) * d + i % d] = s.particle[i / d][i % d];
    if (t != 0) return;
    std::uint64_t least = ~std::uint64_t{0};
    for (int p = 0; p < kParticles && lane.block * kParticles + p < particles; ++p) {
      const std::uint64_t key = static_cast<std::uint64_t>(static_cast<std::uint32_t>(ScalarLanes::as_int(s.cost[p]))) << 32 |
                                static_cast<std::uint32_t>(lane.block * kParticles + p);
      least = key < least ? key : least;
    }
    state.block_key[iteration & 1][lane.block] = least;
    s.winner = static_cast<std::int32_t>(static_cast<std::uint32_t>(least));
  }
};

}  // namespace booth::fit::device
