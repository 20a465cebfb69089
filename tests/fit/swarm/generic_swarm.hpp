// Particle-swarm optimisation as the paper uses it (docs/design/energy.md) over any function: what the back-ends' own swarm is tested against.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "fit/parallel.hpp"
#include "fit/swarm/random.hpp"
#include "fit/swarm/swarm_settings.hpp"

namespace booth::fit {

/// Global-best swarm. The result depends on the seed and the frame only, never on the number of threads: every random number is keyed by
/// (particle, dimension, iteration) and the best particle is sought in index order.
class Swarm {
 public:
  Swarm(SwarmSettings settings, int dimensions, WorkerPool& pool)
      : settings_(settings),
        dimensions_(dimensions),
        pool_(pool),
        position_(static_cast<std::size_t>(settings.particles * dimensions)),
        velocity_(position_.size()),
        best_(position_.size()),
        cost_(static_cast<std::size_t>(settings.particles)),
        best_cost_(cost_.size()),
        global_(static_cast<std::size_t>(dimensions)),
        history_(static_cast<std::size_t>(settings.iterations)) {}

  static constexpr int kTasks = 16;

  /// Particle p starts about centres[p % number of centres] (`centres` holds whole vectors one after the other) with a normal deviation of
  /// `deviation` in each dimension; the first particle of each centre starts on it. Velocities stay within half a deviation.
  /// `cost(task, position)` is called from several threads, never twice at a time with the same task (< kTasks). Returns the least cost; best() is where.
  template <typename Cost>
  float minimise(std::span<const float> centres, std::span<const float> deviation, const Random& random, Cost&& cost) {
    const int n = settings_.particles, d = dimensions_, starts = static_cast<int>(centres.size()) / d;
    global_cost_ = std::numeric_limits<float>::max();
    for (int iteration = 0; iteration < settings_.iterations; ++iteration) {
      const float progress = settings_.iterations > 1 ? static_cast<float>(iteration) / static_cast<float>(settings_.iterations - 1) : 1.0f;
      const float inertia = settings_.inertia_first + (settings_.inertia_last - settings_.inertia_first) * progress;
      pool_.run(kTasks, [&](int task) {
        for (int p = n * task / kTasks; p < n * (task + 1) / kTasks; ++p) {
          float* x = &position_[static_cast<std::size_t>(p * d)];
          float* v = &velocity_[static_cast<std::size_t>(p * d)];
          float* own = &best_[static_cast<std::size_t>(p * d)];
          if (iteration == 0) {
            const float* centre = centres.data() + (p % starts) * d;
            for (int k = 0; k < d; ++k) {
              const auto words = random.words(static_cast<std::uint32_t>(p), static_cast<std::uint32_t>(k), 0);
              x[k] = centre[k] + (p < starts ? 0.0f : deviation[k] * Random::normal(words));
              v[k] = 0.5f * deviation[k] * (2 * Random::uniform(move_word(random, p, k, 0)) - 1);
            }
          } else {
            for (int k = 0; k < d; ++k) {
              const std::uint32_t word = move_word(random, p, k, iteration);
              const float limit = 0.5f * deviation[k];
              const float speed = inertia * v[k] + settings_.cognitive * Random::low(word) * (own[k] - x[k]) +
                                  settings_.social * Random::high(word) * (global_[static_cast<std::size_t>(k)] - x[k]);
              v[k] = std::clamp(speed, -limit, limit);
              x[k] += v[k];
            }
          }
          const float c = cost(task, static_cast<const float*>(x));
          cost_[static_cast<std::size_t>(p)] = c;
          if (iteration == 0 || c < best_cost_[static_cast<std::size_t>(p)]) {
            best_cost_[static_cast<std::size_t>(p)] = c;
            std::copy_n(x, d, own);
          }
        }
      });
      for (int p = 0; p < n; ++p) {
        if (best_cost_[static_cast<std::size_t>(p)] < global_cost_) {
          global_cost_ = best_cost_[static_cast<std::size_t>(p)];
          std::copy_n(&best_[static_cast<std::size_t>(p * d)], d, global_.begin());
        }
      }
      history_[static_cast<std::size_t>(iteration)] = global_cost_;
    }
    return global_cost_;
  }

  std::span<const float> best() const { return global_; }
  /// Least cost after each iteration of the last minimise().
  std::span<const float> history() const { return history_; }
  const SwarmSettings& settings() const { return settings_; }
  std::size_t memory_bytes() const { return (position_.size() * 3 + cost_.size() * 2 + global_.size() + history_.size()) * sizeof(float); }

 private:
  /// Four dimensions share a draw, a word each.
  static std::uint32_t move_word(const Random& random, int particle, int dimension, int iteration) {
    return random.words(static_cast<std::uint32_t>(particle), static_cast<std::uint32_t>(dimension / 4),
                        static_cast<std::uint32_t>(iteration + 1))[static_cast<std::size_t>(dimension % 4)];
  }

  SwarmSettings settings_;
  int dimensions_;
  WorkerPool& pool_;
  std::vector<float> position_, velocity_, best_, cost_, best_cost_, global_, history_;
  float global_cost_ = std::numeric_limits<float>::max();
};

}  // namespace booth::fit
