// A body with its skeleton and motion as binary glTF, which web viewers, Blender and game engines open.
#pragma once

#include <filesystem>
#include <span>

#include "daemon/io/atomic_file.hpp"
#include "fit/body/body_model.hpp"

namespace booth::daemon {

struct GlbBody {
  const fit::BodyModel& model;                   ///< topology, skinning weights, resting rotations
  const fit::Vertices& rest_vertices;            ///< the individual in the A-pose, root joint at the origin (BodyModel::shaped())
  const fit::Points3& rest_joints;               ///< the individual's (BodyModel::rest_joints())
  const fit::PoseVector& pose;                   ///< how the skeleton stands when nothing plays
  std::span<const fit::PoseVector> motion = {};  ///< empty: no animation
  double frame_seconds = 1.0 / 30;               ///< between two poses of `motion`
};

/// glTF 2.0: one skinned mesh (4 weights a vertex) on 24 nodes that bear the bones' names and stand where the bones start; points without a bone
/// behind them (hands', toes' and head's end) are nodes named after the joint. Metres; y up, z forward: the CMU frame is glTF's frame.
/// Throws std::invalid_argument when sizes do not agree, and what AtomicFile throws.
void write_glb(const FileTarget& target, const GlbBody& body);

}  // namespace booth::daemon
