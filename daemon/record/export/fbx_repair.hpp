// assimp 5.2 leaves out the records that end lists of children in some places of a binary FBX; without them no reader (assimp's own, Blender's) goes on.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace booth::daemon {

/// The same nodes with every list of children ended and all offsets right. Nothing when the bytes are no binary FBX 7.5 (64-bit offsets).
std::optional<std::string> repair_fbx(std::string_view bytes);

}  // namespace booth::daemon
