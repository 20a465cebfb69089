// Preset `paper`: one swarm a frame over all 51 unknowns, started about the frame before, as published.
#pragma once

#include <vector>

#include "fit/swarm/backend.hpp"
#include "fit/track/booth_fitter.hpp"

namespace booth::fit {

/// Allocates in the constructor only. One thread calls at a time.
class PaperFitter {
 public:
  static constexpr int kShapeCount = 15;  ///< 36 + 15 = the paper's 51 unknowns
  static constexpr int kVertices = 1008;

  /// `index` is the model's among those of the back-end, which must outlive the fitter and may serve others too.
  PaperFitter(const BodyModel& model, const PosePrior& prior, SwarmBackend& backend, int index);

  void reset() { known_ = false; }
  bool known() const { return known_; }

  /// The back-end must have been given the observation's cloud. The first call starts from the template at the cloud's centroid and eight
  /// headings (or from `initial`), later ones from the solution before; `remember` keeps the result for that.
  Solution step(const Observation& observation, const RandomKey& key, const PoseVector* initial);
  void adopt(const Solution& solution);

  /// The energy's terms at a solution, over the cloud that the back-end has.
  ParticleTerms terms(const Solution& solution);
  const BodyModel& model() const { return model_; }
  std::size_t memory_bytes() const { return (centres_.capacity() + deviation_.capacity() + last_.capacity() + particle_.capacity()) * sizeof(float); }

 private:
  const BodyModel& model_;
  const PosePrior& prior_;
  SwarmBackend& backend_;
  int index_;
  std::vector<float> centres_, deviation_;
  std::vector<float> last_, particle_;
  bool known_ = false;
};

}  // namespace booth::fit
