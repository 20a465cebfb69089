// Reads a folder of joint-angle sequences (train/q.npy with train/clips.csv) and the list of what is set aside from it.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace booth::daemon {

enum class MotionUse { training, held_out, excluded };

struct MotionClip {
  std::string name, trial, subject, motion_class;
  int start = 0, frames = 0;  ///< columns of MotionFolder::q
  MotionUse use = MotionUse::training;
};

struct MotionFolder {
  Eigen::MatrixXf q;  ///< 36 x N, 30 frames/s; radians, metres
  std::vector<MotionClip> clips;
};

/// `held_out`: held_out_motions.csv (# comments, then kind,id,use,note with kind subject, trial or class; later lines win).
/// Throws std::runtime_error that names file, line and remedy.
MotionFolder load_motion_folder(const std::filesystem::path& folder, const std::filesystem::path& held_out);

}  // namespace booth::daemon
