// What an artist's morphable body consists of, in memory: one mesh, displacements of it, named inner points, and a rig's weights.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace booth::fit::train {

/// Displacement of some vertices, metres.
struct Target {
  std::vector<int> vertex;
  std::vector<Eigen::Vector3f> offset;
};

/// Metres; y up, z forward, x to the person's left; left-right symmetric.
struct BaseBody {
  Eigen::Matrix3Xd vertices;                                          ///< the whole mesh; the person's skin stands first
  int skin_vertices = 0;                                              ///< how many of them are skin
  std::vector<std::array<int, 4>> quads;                              ///< of the skin, counter-clockwise seen from outside; closed
  std::vector<std::array<int, 4>> occluder_quads;                     ///< eyeballs: they hide what lies behind them
  std::map<std::string, std::vector<int>> points;                     ///< named inner point -> the vertices whose mean it is (joint-l-knee ...)
  std::map<std::string, Target> targets;                              ///< path without ending -> displacement; defects of the data are already mended
  std::map<std::string, std::vector<std::pair<int, float>>> weights;  ///< rig bone -> (vertex, weight), as stored (sums are not 1)
};

/// A point as a fixed weighted mean of others: index and weight; the weights sum to 1.
using SparseRow = std::vector<std::pair<int, float>>;

}  // namespace booth::fit::train
