// Captured views as a folder of pictures: what `boothctl calibrate --from` reads and the capture writes, so that a calibration can be made again elsewhere.
#pragma once

#include <filesystem>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// DIR/calibration.toml with one [[camera]] table each (camera_to_world: where it should stand), and for each camera a folder of its name
/// with `view-NNN.infrared.png` and `view-NNN.depth.png` (16-bit grey). A camera may lack pictures of a view, and depth of any.
struct ViewFolder {
  std::filesystem::path path;
  std::vector<hal::CameraDescription> cameras;
  std::vector<std::filesystem::path> folders;  ///< of each camera
  int views = 0;                               ///< one more than the highest number
};
/// Throws std::runtime_error naming what is missing.
ViewFolder open_view_folder(const std::filesystem::path& path);
/// The pictures of one view; cameras without an infrared picture are left out, depth is empty where there is none. Throws std::runtime_error.
std::vector<hal::DepthFrame> read_view(const ViewFolder& folder, int view);

/// Creates the folder (it may exist when empty) and its calibration.toml.
ViewFolder create_view_folder(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras);
/// Appends a view: frames with infrared; those without are left out. Throws std::runtime_error.
void write_view(ViewFolder& folder, const std::vector<hal::DepthFrame>& frames);

}  // namespace booth::daemon
