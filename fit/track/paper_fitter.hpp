// Preset `paper`: one swarm a frame over all 51 unknowns, started about the frame before, as published.
#pragma once

#include <vector>

#include "fit/cloud/nearest_field.hpp"
#include "fit/energy/paper_energy.hpp"
#include "fit/swarm/swarm.hpp"
#include "fit/track/booth_fitter.hpp"

namespace booth::fit {

/// Allocates in the constructor only. One thread calls at a time.
class PaperFitter {
 public:
  static constexpr int kShapeCount = 15;  ///< 36 + 15 = the paper's 51 unknowns
  static constexpr int kVertices = 1024;

  PaperFitter(const BodyModel& model, const PosePrior& prior, WorkerPool& pool);

  void reset() { known_ = false; }
  bool known() const { return known_; }

  /// The field must have been built over the observation's cloud. The first call starts from the template at the cloud's centroid and eight
  /// headings (or from `initial`), later ones from the solution before; `remember` keeps the result for that.
  Solution step(const Observation& observation, const NearestField& field, const Random& random, const PoseVector* initial);
  void adopt(const Solution& solution);

  const PaperEnergy& energy() const { return energy_; }
  std::span<const float> history() const { return swarm_.history(); }
  const BodyModel& model() const { return model_; }
  std::size_t memory_bytes() const { return swarm_.memory_bytes(); }

 private:
  const BodyModel& model_;
  const PosePrior& prior_;
  PaperEnergy energy_;
  Swarm swarm_;
  std::vector<float> centres_, deviation_;
  std::vector<float> last_;
  bool known_ = false;
};

}  // namespace booth::fit
