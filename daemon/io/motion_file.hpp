// Motions from files: .npy sequences of q, and CMU's .amc and MotionBuilder-friendly .bvh on the average skeleton.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "fit/body/skeleton.hpp"

namespace booth::daemon {

/// True for a name that ends in .npy, .amc or .bvh.
bool is_motion_file(std::string_view name);

/// q at 30 frames a second, at least one. The path (q[0], q[2]) is the file's, in metres.
/// .npy: float array N x 36. .amc: 120 Hz, every fourth frame. .bvh (the CMU conversion's layout and names): the T-pose in front is dropped and
/// frames are taken 1/30 s apart by its Frame Time. The trunk's and neck's extra joints are folded into the 36 angles (cmu_fold.hpp).
/// Throws std::runtime_error naming the file, the line and what is wrong.
std::vector<fit::PoseVector> read_motion(const std::filesystem::path& path);

}  // namespace booth::daemon
