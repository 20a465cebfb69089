// What the estimator sees of one moment: the person's points and, where cameras are known, what each of them saw and did not see.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace booth::fit {

/// A depth camera in the CMU frame (y up, z forward, x left). Pixel (0, 0) is the centre of the first pixel.
struct Camera {
  int width = 0, height = 0;
  float fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<float, 5> distortion{};                       ///< k1 k2 p1 p2 k3 (Brown-Conrady)
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();  ///< camera from CMU world: x_cam = rotation * x + translation
  Eigen::Vector3f translation = Eigen::Vector3f::Zero();
  float depth_scale = 0.001f;  ///< metres per count
  float depth_offset = 0;      ///< metres; a count c means c * depth_scale + depth_offset

  Eigen::Vector3f centre() const { return -rotation.transpose() * translation; }
};

/// The person's points, structure of arrays with a fixed capacity; CMU frame, metres.
class Cloud {
 public:
  explicit Cloud(int capacity);
  int size = 0;
  int capacity() const { return static_cast<int>(x.size()); }
  void clear() { size = 0; }
  /// False when full.
  bool push(const Eigen::Vector3f& p, const Eigen::Vector3f& n, std::uint8_t camera);

  std::vector<float> x, y, z;
  std::vector<float> nx, ny, nz;     ///< unit normals pointing out of the body (towards the camera that saw the point); zero where unknown
  std::vector<std::uint8_t> camera;  ///< which view saw it; 0 when there are no views
};

/// What one pixel of a view says.
enum class PixelLabel : std::uint8_t {
  unknown,     ///< no measurement: no evidence of anything
  person,      ///< the tracked person's surface
  background,  ///< another surface (floor, wall, another person ...): the space before it is free
};

/// One camera's evidence. Pixel arrays are row-major width * height, allocated once.
struct View {
  Camera camera;
  float time_offset = 0;     ///< seconds from the observation's reference instant to this camera's exposure
  bool valid = false;        ///< false: this camera gave no frame to the group
  std::vector<float> depth;  ///< metres along z; 0 = no measurement
  std::vector<PixelLabel> label;
  /// For every kSilhouetteStep-th pixel in both directions: offset in pixels to the nearest person pixel, (0, 0) inside,
  /// (kSilhouetteFar, kSilhouetteFar) where none is near. (width / step) x (height / step), row-major.
  std::vector<std::int16_t> nearest_dx, nearest_dy;
};
inline constexpr int kSilhouetteStep = 4;
/// How many of the silhouette's places a row or column of so many pixels has; what is left of a step at the edge has one, too.
constexpr int silhouette_places(int pixels) { return (pixels + kSilhouetteStep - 1) / kSilhouetteStep; }
inline constexpr std::int16_t kSilhouetteFar = 1000;

/// Fixed buffers, filled again for every group of frames.
struct Observation {
  explicit Observation(int cloud_capacity) : cloud(cloud_capacity) {}
  std::uint64_t frame = 0;  ///< number of the group; keys the random numbers
  double time = 0;          ///< reference instant, seconds on any steady scale; only differences matter
  Cloud cloud;
  std::vector<View> views;  ///< empty when only a cloud is known
  /// Height of the floor in the CMU frame (y); nothing below it belongs to the person.
  float floor_height = 0;
  bool floor_known = false;
  bool crowded = false;  ///< others touch the person: some of the cloud's points may be theirs, and some of the person's may be missing
};

}  // namespace booth::fit
