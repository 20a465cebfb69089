// What evaluates preset `paper`'s swarm: one interface, so that the particles can live on the CPU or on a graphics processor.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fit/cloud/cell_field.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/energy/energy_pack.hpp"
#include "fit/gpu/device.hpp"
#include "fit/parallel.hpp"
#include "fit/swarm/move.hpp"
#include "fit/swarm/swarm_settings.hpp"

namespace booth::fit {

/// All sizes of a back-end: memory is taken for these at construction and never again.
struct SwarmSizes {
  SwarmSettings swarm{};
  EnergyPackSettings energy{};
  FieldSettings field{};
};

using gpu::DeviceBytes;

/// Of one minimise(); the spans belong to the back-end and hold until the next call.
struct SwarmResult {
  std::span<const float> best;     ///< q, then beta
  float cost = 0;                  ///< eq. 4 at `best`
  std::span<const float> history;  ///< least cost after each iteration
};

/// A global-best swarm over the paper's energy. One back-end serves several models (men and women) over the same cloud. One thread calls at a time.
/// The result is a function of the cloud, the model, the centres, the deviations and the key: on the CPU the same bits for every number of threads, with
/// AVX2 and with AVX-512, and within a tested bound of those elsewhere; on a graphics processor the same bits on the same device, likewise within a bound.
/// After construction nothing allocates. False from set_cloud(), minimise() or evaluate() means that the back-end is lost (never the CPU): its results are
/// void, and somebody else must take over.
class SwarmBackend {
 public:
  virtual ~SwarmBackend() = default;
  virtual const char* name() const = 0;  ///< "cpu avx512", ...
  /// Why the last call returned false; empty where none did.
  virtual const char* problem() const { return ""; }

  /// The frame's cloud (CMU frame): builds the nearest-point field. The cloud need not outlive the call.
  [[nodiscard]] virtual bool set_cloud(const Cloud& cloud) = 0;

  /// Particle p starts about centres[p % starts], where `centres` holds `starts` whole vectors one after the other, with a normal deviation of
  /// `deviation` in each dimension; the first particle of each centre starts on it. Velocities stay within half a deviation.
  /// `model` is the index among the models given at construction. 1 <= starts <= kMostStarts.
  [[nodiscard]] virtual bool minimise(int model, std::span<const float> centres, std::span<const float> deviation, const RandomKey& key, SwarmResult& out) = 0;
  static constexpr int kMostStarts = 64;

  /// The terms of one particle (unweighted), for reports and tests.
  [[nodiscard]] virtual bool evaluate(int model, std::span<const float> particle, ParticleTerms& out) = 0;

  virtual int dimensions(int model) const = 0;
  virtual const SwarmSettings& settings() const = 0;
  /// Ordinary memory.
  virtual std::size_t memory_bytes() const = 0;
  virtual DeviceBytes device_bytes() const { return {}; }
};

/// The swarm on the CPU. The models and the prior are only read here; the pool must outlive the back-end. `kernel` names one of swarm_kernels(); empty: the
/// best that this processor has. Throws std::invalid_argument naming the setting that is wrong.
std::unique_ptr<SwarmBackend> make_cpu_swarm(std::span<const BodyModel* const> models, const PosePrior& prior, const SwarmSizes& sizes, WorkerPool& pool,
                                             const std::string& kernel = {});

}  // namespace booth::fit
