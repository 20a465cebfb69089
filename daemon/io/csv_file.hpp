// The skeleton as a table: one row a frame, so that a spreadsheet or numpy.loadtxt reads it.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "daemon/io/atomic_file.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {

/// One frame as the estimator has it: CMU frame, metres, radians.
struct SkeletonRow {
  double time = 0;          ///< seconds since the first frame of the session or recording
  std::int64_t utc_ns = 0;  ///< wall time of the frame, nanoseconds since 1970; 0 where unknown
  std::string_view state;   ///< "estimated", "tracked", "lost"; no commas
  double residual = 0;      ///< metres; mean distance of the cloud to the fitted surface
  fit::PoseVector q = fit::PoseVector::Zero();
  fit::Points3 joints = fit::Points3::Zero();
};

/// Column names with their units, ending in a newline:
/// time_s,utc_ns,state,residual_m, the 36 entries of q (root_tx_m .. rfoot_rz_rad, CMU frame), and 24 x (JOINT_x_m,JOINT_y_m,JOINT_z_m), booth frame.
std::string skeleton_csv_header();

/// Appends the row's line to `out`; joints are turned into the booth frame. Numbers are written so that reading them gives the same float bits;
/// independent of the locale. Allocates only when `out` must grow (about 2 KB a row).
void append_skeleton_csv(std::string& out, const SkeletonRow& row);

/// Header and rows, through AtomicFile (whose errors it throws).
void write_skeleton_csv(const FileTarget& target, std::span<const SkeletonRow> rows);

}  // namespace booth::daemon
