// The poses that bodies are measured in: the study's three, and random ones of the kinds that a start must survive.
#pragma once

#include <string_view>
#include <vector>

#include "fit/train/random.hpp"
#include "tests/accuracy/booth/subjects.hpp"

namespace booth::accuracy {

using fit::train::Random;

/// 1: the template's A-pose. 2: both arms raised and bent, differently. 3: a kick to the front with the trunk twisted. Angles only; see on_stage().
fit::PoseVector study_pose(const Subject& subject, int number);

enum class PoseKind { standing, lying, crouching, arms_crossed, legs_touching };
inline constexpr PoseKind kPoseKinds[]{PoseKind::standing, PoseKind::lying, PoseKind::crouching, PoseKind::arms_crossed, PoseKind::legs_touching};
std::string_view name_of(PoseKind kind);

/// A random pose of the kind, heading included. `recorded` (36 x N columns of q, may be empty) are frames of motions set aside; without them a standing pose
/// is an instant of a motion that the project wrote, its limbs moved at random.
fit::PoseVector random_pose(const Subject& subject, PoseKind kind, const Eigen::MatrixXf& recorded, Random& random);

/// Turns the pose to `heading`, puts the body's lowest point on the floor and its middle at (x, z); CMU frame, metres.
fit::PoseVector on_stage(const Subject& subject, fit::PoseVector q, double heading, double x, double z);
/// The same with a random heading and place at most `radius` from the centre.
fit::PoseVector anywhere(const Subject& subject, const fit::PoseVector& q, double radius, Random& random);

/// Frames of the motions set aside in the folder, 36 x N; every `stride`-th.
Eigen::MatrixXf held_out_frames(const std::filesystem::path& data, const Subjects& subjects, int stride);

}  // namespace booth::accuracy
