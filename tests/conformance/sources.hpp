// The kinds of depth source that the conformance suite is run against, all showing the same scene.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/source.hpp"
#include "drivers/synthetic/scene.hpp"
#include "hal/clock.hpp"

namespace booth::tests {

enum class Kind { synthetic, folder, rosbag2, kinect2 };  ///< kinect2: the driver on emulated sensors
const char* name_of(Kind kind);

inline constexpr int kSceneFrames = 36;        ///< frames of each camera
inline constexpr int kCorner = 0, kFront = 1;  ///< the scene's two cameras: a corner of the ring, and one straight in front

/// A man of capsules who stands in the middle, faces +x and holds up his left arm; Kinect v2 noise.
drivers::SceneSettings scene_settings(std::uint64_t seed);
drivers::Person scene_person();

/// A scratch folder that is removed with its owner.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Records the scene as it is and returns the recording's path inside `scratch`.
std::filesystem::path record_scene(const ScratchFolder& scratch, Kind kind, std::uint64_t seed);

/// Opens the scene, or a recording of it that was made in `scratch` before.
drivers::Source open_scene(const ScratchFolder& scratch, Kind kind, drivers::Pace pace, std::shared_ptr<hal::Clock> clock, std::uint64_t seed = 7);

}  // namespace booth::tests
