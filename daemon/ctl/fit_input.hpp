// What `boothctl fit` reads: clouds and meshes of one moment, viewpoints, a first pose.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/io/mesh_file.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {

/// CMU frame, metres.
struct FitInput {
  Eigen::Matrix3Xf points;
  Eigen::Matrix3Xf normals;       ///< pointing outwards; empty when the files have none that can be relied on
  std::int64_t dropped = 0;       ///< points that were no numbers
  std::int64_t floor_points = 0;  ///< points of the floor and of what lies on it apart from the person, taken out
  bool floor_known = false;
  float floor_height = 0;          ///< m (y), where a floor was taken out
  std::vector<std::string> notes;  ///< what a person should know: sampled, dropped, turned round, converted
};

/// Reads files of one moment and puts them together. A mesh is replaced by points spread evenly over its area. A floor that was scanned with the person is
/// found and taken out.
/// Throws what read_cloud_file() throws, and std::runtime_error when fewer than 200 points are left.
FitInput read_fit_input(const std::vector<std::filesystem::path>& files, const CloudReadOptions& options);

/// `count` points spread evenly by area over the triangles, each with its triangle's normal. Deterministic. Degenerate triangles get none;
/// no points at all when there is no area.
void sample_surface(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, int count, Eigen::Matrix3Xf& points, Eigen::Matrix3Xf& normals);

/// Camera centres of a calibration file (the [[camera]] tables' camera_to_world), CMU frame. `up`: the axes that the calibration and the clouds share.
/// Throws std::runtime_error naming file, line, key and what is allowed.
std::vector<Eigen::Vector3f> read_viewpoints(const std::filesystem::path& calibration, UpAxis up);

/// A JSON file that is an array of 36 numbers or an object with such an array under "q" (fit.json is one). Throws std::runtime_error.
fit::PoseVector read_initial_pose(const std::filesystem::path& path);

}  // namespace booth::daemon
