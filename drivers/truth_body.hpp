// The body behind a recording's truth as plain values: what truth.ply holds.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

namespace booth::drivers {

inline constexpr int kTruthSkinBones = 4;
inline constexpr int kTruthBones = 24;

/// CMU axes (y up, z forward, x left), metres; bones in the order of docs/reference/skeleton.md.
struct TruthBody {
  std::string name;                    ///< e.g. "test:7"
  std::string sex;                     ///< "men" or "women"
  std::vector<double> beta;            ///< empty when the body is not in the shape space
  std::array<double, 36> rest_pose{};  ///< q_rest
  std::array<std::array<double, 3>, kTruthBones> rest_joints{};
  std::vector<std::array<float, 3>> vertices;  ///< at rest
  std::vector<std::array<int, 3>> faces;
  std::vector<std::array<int, kTruthSkinBones>> bones;  ///< per vertex
  std::vector<std::array<float, kTruthSkinBones>> weights;
};

/// The body's surface in pose q, booth frame, metres. Recordings are read without kinematics; who has them passes this in
/// (drivers/synthetic/truth_surface.hpp), and without it the recorded truth has joints but no surface.
using TruthSurface = std::function<std::vector<std::array<float, 3>>(const TruthBody& body, const std::array<double, 36>& q)>;

}  // namespace booth::drivers
