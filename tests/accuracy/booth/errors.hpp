// How far a fitted body is from the true one.
#pragma once

#include <string_view>

#include "fit/estimator.hpp"
#include "tests/accuracy/booth/subjects.hpp"
#include "tests/accuracy/report/samples.hpp"

namespace booth::accuracy {

/// What any method says of a person; CMU frame, metres. `joints` and `bone_lengths` may be absent (a method without a skeleton).
struct FittedBody {
  fit::Vertices vertices;  ///< on the template's topology
  bool has_joints = false;
  fit::Points3 joints;
  Eigen::Matrix<double, fit::kBones, 1> bone_lengths = Eigen::Matrix<double, fit::kBones, 1>::Zero();
};

/// Mean distance of the 15 main joints, metres.
double main_joint_error(const fit::Points3& joints, const fit::Points3& truth);

inline constexpr std::string_view kToVertex = "vertex to true vertex", kToSurface = "vertex to true surface", kJoints = "15 main joints",
                                  kBones = "bone lengths";

/// Adds the body's errors in cm: of every vertex to the true vertex and to the true surface (weighted by area, and unweighted), joints, and bones.
void add_errors(const FittedBody& fitted, const Subject& subject, const fit::PoseVector& truth, std::string_view case_name, std::string_view method,
                Samples& out);

/// Distance of each fitted vertex to the true surface, metres.
std::vector<float> surface_distances(const fit::Vertices& fitted, const Subject& subject, const fit::PoseVector& truth);

}  // namespace booth::accuracy
