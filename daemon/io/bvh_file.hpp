// The skeleton and its motion as BVH, which every animation program reads.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "daemon/io/atomic_file.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {

/// Node b bears the name of bone b (CMU's), stands where the bone starts and turns what hangs on it; a bone without children ends in an End Site.
/// Offsets are the bone vectors in the neutral pose (q = 0, a T-pose); channels are Zrotation Yrotation Xrotation in degrees, at the root after
/// Xposition Yposition Zposition. Y is up and +z forward (the CMU frame), as animation programs expect; lengths are metres.
/// `frame_seconds` > 0: time between two poses.
std::string bvh_text(const fit::Points3& bone_vectors, std::span<const fit::PoseVector> poses, double frame_seconds);

/// bvh_text() through AtomicFile (whose errors it throws).
void write_bvh(const FileTarget& target, const fit::Points3& bone_vectors, std::span<const fit::PoseVector> poses, double frame_seconds);

}  // namespace booth::daemon
