// The two layouts behind recording.hpp.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/recording/frame_store.hpp"
#include "drivers/recording/recording.hpp"

namespace booth::drivers {

/// Throw std::runtime_error naming file, place and remedy.
std::vector<RecordedCameraData> read_folder(const std::filesystem::path& path);
/// `live`, where not null, gets what the live booth did with the frames, where the bag says it.
std::vector<RecordedCameraData> read_rosbag2(const std::filesystem::path& path, LiveGroups* live = nullptr);

std::unique_ptr<hal::DepthSink> write_folder(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                             const std::optional<TruthBody>& body, const std::vector<hal::DepthFrame>& background);
std::unique_ptr<hal::DepthSink> write_rosbag2(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                              const std::optional<TruthBody>& body, const std::vector<hal::DepthFrame>& background, bool compressed);

/// What any layout must hold to: finite intrinsics, a right-handed rotation (made exactly orthonormal here), sizes that 64 MiB of depth can have.
/// Throws std::runtime_error beginning with `place`.
void check_description(hal::CameraDescription& camera, const std::string& place);

/// Pictures of the empty room that are read of one camera: packed ones are small on the disk and large in memory.
inline constexpr std::size_t kMostBackgroundBytes = std::size_t{256} << 20;
inline std::size_t most_background(const hal::Intrinsics& k) {
  return kMostBackgroundBytes / (sizeof(std::uint16_t) * static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height));
}

/// The camera that a frame to be written is of. Throws std::runtime_error when there is none or the picture has another size.
const hal::CameraDescription& camera_of(const hal::DepthFrame& frame, const std::vector<hal::CameraDescription>& cameras);

}  // namespace booth::drivers
