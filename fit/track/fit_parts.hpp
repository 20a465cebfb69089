// Parts of the fit that can be left out, so that the accuracy study can say what each of them is worth.
#pragma once

namespace booth::fit {

/// All true is the product. The first two act on both presets, the others on preset `booth` alone. Meant for the fit of one moment: what tracking learns of a
/// shape over many frames is always added to the full prior.
struct FitParts {
  bool pose_prior = true;   ///< subspace, spread inside it, joint limits (eq. 12 and ours)
  bool shape_prior = true;  ///< |beta|^2 (eq. 9)
  bool symmetry = true;     ///< left and right limbs alike (eq. 7)
  bool two_sided = true;    ///< false: the model's distance from the cloud alone, as published: no cloud-to-model, no free space
  bool refinement = true;   ///< false: the best candidate of the search as it is
};

}  // namespace booth::fit
