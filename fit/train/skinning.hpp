// Skinning weights for our bones from the base body's finer rig.
#pragma once

#include "fit/body/body_model.hpp"
#include "fit/train/base_body.hpp"
#include "fit/train/template_mesh.hpp"

namespace booth::fit::train {

/// Fills skin_bone and skin_weight of `model` (faces and mirror_vertex must be there): at most four bones, symmetric, columns sum to 1.
/// Bones that do not turn get no weight; the hand moves with the radius, the toes with the foot.
void transfer_skinning(const BaseBody& base, const TemplateMesh& mesh, BodyModelData& model);

}  // namespace booth::fit::train
