// One simulated depth camera's picture: the room is traced once, bodies are rasterised over it, noise comes last.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "drivers/synthetic/scene.hpp"

namespace booth::drivers {

/// Allocates in the constructor and, for the vertices of a body, in reserve(); begin(), draw() and finish() do not. One thread at a time.
class Renderer {
 public:
  Renderer(const hal::CameraDescription& camera, int camera_index, const SceneSettings& settings);

  void reserve(int vertices);
  /// Back to the empty room.
  void begin();
  /// `vertices` in the CMU frame, metres; faces counter-clockwise from outside; dark[f] != 0 marks a face that reflects badly (hair).
  void draw(const fit::Vertices& vertices, const fit::Faces& faces, const std::vector<std::uint8_t>& dark);
  /// Depth counts with the noise of this frame number; the same (seed, camera, frame) gives the same bits.
  void finish(std::uint64_t frame, std::uint16_t* out);

 private:
  struct Quality {
    float sigma;        // metres
    std::uint8_t drop;  // probability of no measurement, in 1/256
  };
  struct Corner {
    float u, v, z;
  };

  void trace_room(const SceneSettings& settings);
  Quality quality(float z, float cosine, bool dark) const;
  void fill(const Corner& a, const Corner& b, const Corner& c, Quality q);
  void add_edge_effects(std::uint64_t key, std::uint16_t* out);
  void edge_pixel(int x, int y, std::uint64_t key, std::uint16_t* out);

  const hal::CameraDescription camera_;
  const int camera_index_, width_, height_;
  const NoiseModel noise_;
  const std::uint64_t seed_;
  const float range_min_, range_max_;
  Eigen::Matrix3f from_cmu_;  // camera from CMU world
  Eigen::Vector3f origin_shift_;
  float radius_limit_;             // beyond this |ray|^2 a point cannot be in the picture
  std::vector<float> room_z_, z_;  // along the optical axis; kFar where nothing is hit
  std::vector<float> room_sigma_, sigma_;
  std::vector<std::uint8_t> room_drop_, drop_;
  std::vector<std::int32_t> room_edges_;  // pixels at depth edges of the empty room
  std::vector<Corner> corner_;
  Eigen::Matrix3Xf in_camera_;
  int left_, right_, top_, bottom_;  // what draw() touched, inclusive
};

}  // namespace booth::drivers
