// FBX, for programs that read nothing else: made from our glTF by assimp.
#pragma once

#include <filesystem>

namespace booth::daemon {

/// Mesh, skeleton and animation (evenly sampled, `rate` frames per second) of a .glb as binary FBX 7.5, written as a whole or not at all. Throws
/// std::runtime_error naming the file and the reason.
void convert_glb_to_fbx(const std::filesystem::path& glb, const std::filesystem::path& fbx, int rate);

}  // namespace booth::daemon
