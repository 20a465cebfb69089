// Turns one group of depth images, or a cloud from a file, into an Observation: the person's points, and what each camera says of every pixel.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "fit/cloud/observation.hpp"

namespace booth::fit {

/// CMU frame (y up), metres. The defaults are the booth's; why they are what they are: docs/design/cloud.md.
struct CloudSettings {
  float stage_x = 0, stage_z = 0;  ///< centre of the stage on the floor
  float stage_radius = 2.0f;       ///< nothing outside this upright cylinder is looked at
  float stage_height = 2.5f;
  float min_depth = 0.3f, max_depth = 8.0f;  ///< measurements outside are no measurements
  float floor_margin = 0.015f;               ///< what lies lower above the floor is floor; up to 0.03 when the floor itself is measured with more noise
  float background_margin = 0.03f;           ///< a pixel is background when it lies no more than this before the background image,
  float background_relative = 0.02f;         ///< or no more than this part of its depth, whichever is larger
  int min_neighbours = 3;                    ///< of 8; a pixel with fewer neighbours on its own surface is dropped as isolated
  float voxel = 0.05f;                       ///< pieces that touch on a grid of this size are one component
  float rejoin_gap = 0.12f;                  ///< pieces too small for a person join what lies nearer than this
  int threads = 2;                           ///< workers, the caller included; the result does not depend on it
};

/// One camera's image of the group.
struct DepthInput {
  int camera = 0;                        ///< index into the builder's cameras
  const std::uint16_t* depth = nullptr;  ///< width * height counts, row-major, 0 = no measurement; not mirrored
  double time_offset = 0;                ///< seconds from the group's reference instant to this exposure
};

/// Whom the tracker follows, as it last saw them: which of several people the person is, and where they end when others touch them.
struct Followed {
  struct Bone {
    Eigen::Vector3f from, to;  ///< CMU frame, metres
    float radius;              ///< m; of the flesh around it, clothes and what it moves between two frames included
  };
  std::span<const Bone> bones;  ///< the trunk's lowest first; empty: nobody is followed
  /// The person is where the bones are. False: that was a moment ago; then the bones only say which of several people is meant.
  bool now = false;
  bool crowded = false;  ///< others touched the person in the frame before
  float strayed = 0;     ///< m; how far from the bones the person may be meanwhile: who is further away is somebody else
};

enum class CloudOutcome : std::uint8_t {
  person,          ///< somebody is there; the cloud is theirs
  no_frame,        ///< no camera gave an image
  no_measurement,  ///< every pixel of every image, or every point of the cloud, is invalid
  empty_stage,     ///< nothing stands on the stage
  nobody,          ///< something stands on the stage, but nothing of a person's size
  unprepared,      ///< the Observation was not made by this builder's make_observation()
};

/// The outcome as a person reads it, e.g. "the stage is empty".
const char* describe(CloudOutcome outcome);

/// What happened to the pixels (or points) of one group.
struct CloudReport {
  CloudOutcome outcome = CloudOutcome::no_frame;
  int frames = 0;                            ///< cameras that gave an image
  int raw = 0;                               ///< pixels with a measurement
  int cropped = 0;                           ///< of these: outside the stage, or background by the background image
  int floor = 0;                             ///< on the floor
  int isolated = 0;                          ///< without enough neighbours, or specks
  int flying = 0;                            ///< between two surfaces, as time-of-flight cameras invent them at edges
  int other = 0;                             ///< on other persons or things
  int person = 0;                            ///< on the tracked person: raw = cropped + floor + isolated + flying + other + person
  int points = 0;                            ///< of these: kept in the cloud, whose capacity is limited
  int persons = 0;                           ///< components of a person's size
  int other_components = 0;                  ///< components that are not the tracked person, specks left out
  bool crowded = false;                      ///< others touch the person: what is far from the bones was taken for theirs
  bool touches_border = false;               ///< part of the person may be outside the stage
  bool floor_measured = false;               ///< the floor was seen well enough to correct the calibrated one
  float floor_height = 0;                    ///< at the stage's centre, m
  float floor_tilt_x = 0, floor_tilt_z = 0;  ///< slope along x and z
  float floor_sigma = 0;                     ///< spread of the floor's points, m; 0 where not measured
};

/// Depth images to Observation. Allocates everything in the constructor; build() allocates nothing, throws nothing and gives the same bits for
/// any number of threads. One thread calls at a time.
class CloudBuilder {
 public:
  /// Throws std::invalid_argument that names the camera or the setting that is wrong. 1 to 16 cameras.
  CloudBuilder(CloudSettings settings, std::vector<Camera> cameras);
  ~CloudBuilder();

  /// An Observation with buffers for these cameras.
  Observation make_observation(int cloud_capacity) const;

  /// Remembers what camera `camera` sees when nobody is there (width * height counts, 0 = not known); an empty span forgets it.
  /// Not on the frame path. Throws std::invalid_argument when the camera or the size is wrong.
  void set_background(int camera, std::span<const std::uint16_t> depth);

  /// False when there is no person: report.outcome says why, the views are filled all the same and the cloud is empty. Cameras without an
  /// input are marked invalid; an input for a camera that does not exist, or a second one for the same camera, is ignored.
  /// `frame` and `time` of the observation are the caller's to set. `followed`: the person is whom the bones run through, or else who is nearest to
  /// them and no further away than they may have strayed. With nobody to follow: who is nearest to the stage's centre.
  bool build(std::span<const DepthInput> inputs, Observation& out, CloudReport& report, const Followed& followed = {});

  const std::vector<Camera>& cameras() const;
  /// Bytes taken at construction, for the memory plan.
  std::size_t memory_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct UnorganisedSettings {
  bool largest_component = false;  ///< keep only the largest piece that hangs together
  float component_gap = 0.06f;     ///< m; pieces further apart than this are two
};

/// An Observation without views from points that no image orders (files). `points` in the CMU frame, metres; points that are not finite are left
/// out. `normals` (as many, or none) are kept, normalised; without them they are estimated from the neighbours and turned outwards: away from the
/// body's inside, which a closed cloud shows by itself, and towards the nearest of `viewpoints` (may be empty) where it does not. More points than
/// the cloud holds are thinned to an even spacing. Allocates; deterministic. False when no point is left: report.outcome says why.
/// Throws std::invalid_argument when the numbers of points and normals differ.
bool build_unorganised(const Eigen::Matrix3Xf& points, const Eigen::Matrix3Xf& normals, std::span<const Eigen::Vector3f> viewpoints,
                       const UnorganisedSettings& settings, Observation& out, CloudReport& report);

}  // namespace booth::fit
