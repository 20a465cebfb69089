// People that no shape space holds, as scanners and cameras would see them: set-aside bodies with folds, hair, shoes and clothes, and the truth under these.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "fit/body/measure.hpp"
#include "fit/cloud/observation.hpp"
#include "hal/depth_camera.hpp"

namespace booth::tests {

enum class Outfit : std::uint8_t {
  bare,   ///< skin with folds and muscles of a few millimetres
  tight,  ///< shirt and trousers 2 to 15 mm off the skin
  loose,  ///< clothes 0 to 4 cm off it
};
constexpr std::string_view to_string(Outfit o) { return o == Outfit::bare ? "bare" : o == Outfit::tight ? "tight" : "loose"; }

struct PersonRequest {
  int body = 7;                    ///< of the set-aside bodies, 1 to 90
  std::filesystem::path bodies{};  ///< another file of test bodies; empty: the one beside the models
  std::string_view pose = "a";     ///< a, arms-up, stride, sit, or typical-N: an exemplar of the pose prior
  double heading = 0;              ///< degrees
  Outfit outfit = Outfit::bare;
  bool hair = true, shoes = true;
  std::uint64_t seed = 1;
};

/// CMU frame, metres.
struct DressedPerson {
  std::shared_ptr<const fit::BodyModel> model;  ///< of the person's sex
  fit::Vertices rest;                           ///< the bare body in the A-pose
  fit::MeasureValues measures{};                ///< the tape's truth, of the bare body
  fit::PoseVector q;
  fit::Vertices skin;   ///< posed, bare, on the template's topology
  fit::Points3 joints;  ///< posed, the true ones
  fit::Vertices outer;  ///< posed, what can be seen: a four times finer mesh with everything worn
  fit::Faces outer_faces;
};
/// Throws as load_test_body() does, and std::invalid_argument for an unknown pose.
DressedPerson dress(const PersonRequest& request);

struct ScanRequest {
  int points = 100000;
  float noise = 0.0015f;                           ///< m, along each axis
  int holes = 8;                                   ///< balls of 4 to 9 cm in which the scanner saw nothing
  bool without_arm = false;                        ///< the right arm is missing from the elbow on
  std::uint32_t missing = 0;                       ///< bit b: nothing that belongs to bone b was scanned (bones_missing)
  Eigen::Vector3f side = Eigen::Vector3f::Zero();  ///< not zero: only what faces this way was scanned
  bool floor = false;                              ///< a disc of floor of 1 m radius was scanned too
  std::uint64_t seed = 1;
};
/// Bones of the parts that are named: (l|r)forearm, arm, foot, shank, leg, or head, legs, arms. Throws std::invalid_argument for others.
std::uint32_t bones_missing(std::string_view part);
/// Points of the outer surface as a scanner's file has them: no normals, no order.
Eigen::Matrix3Xf scan_of(const DressedPerson& person, const ScanRequest& request);

/// The person seen by the default booth's four cameras, `noise` as NoiseModel::parse() reads it. False when the cloud builder finds nobody.
class CameraView {
 public:
  explicit CameraView(const std::string& noise, std::uint64_t seed = 1);
  ~CameraView();
  bool look(const fit::Vertices& vertices, const fit::Faces& faces, std::uint64_t frame);
  const fit::Observation& observation() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace booth::tests
