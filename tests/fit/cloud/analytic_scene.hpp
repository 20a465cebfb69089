// Depth images of capsules, boxes, a floor and walls, ray-cast exactly: scenes whose every pixel is known.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/cloud/cloud_builder.hpp"

namespace booth::tests {

/// Kinect v2-like cameras (512 x 424, distorted) at the corners of a 4 m square, 1.6 m high, aimed at (0, 0.95, 0); CMU frame.
std::vector<fit::Camera> booth_cameras(int count = 4);

struct Scene {
  struct Capsule {
    Eigen::Vector3f a, b;
    float radius;
    int owner;
  };
  struct Box {
    Eigen::Vector3f low, high;
    int owner;
  };
  std::vector<Capsule> capsules;
  std::vector<Box> boxes;
  float floor_height = 0, floor_slope_x = 0;  ///< y = height + slope x
  bool floor = true;
  float wall = 3.2f;  ///< half the room's width; 0: no walls
  float noise = 0;    ///< standard deviation of the depth, m
  unsigned seed = 1;

  /// A standing figure of 1.75 m: legs with feet, trunk, head, arms somewhat raised. Owner marks its surfaces in Rendering::owner.
  void add_person(float x, float z, int owner = 1);
  void add_squatting_person(float x, float z, int owner = 1);
  /// Seat, back and four legs, 0.9 m high.
  void add_chair(float x, float z, int owner = 9);
};

struct Rendering {
  std::vector<std::uint16_t> depth;  ///< millimetres
  std::vector<int> owner;            ///< 0 room, -1 floor, -2 nothing
  std::vector<Eigen::Vector3f> normal;
};

Rendering render(const Scene& scene, const fit::Camera& camera, int index);

/// All cameras of a booth, as CloudBuilder takes them. Keeps the pixels alive.
struct BoothFrame {
  BoothFrame(const Scene& scene, const std::vector<fit::Camera>& cameras);
  std::vector<Rendering> images;
  std::vector<fit::DepthInput> inputs;
};

}  // namespace booth::tests
