// What assimp 5.2 writes wrong in a binary FBX: lists of children without the record that ends them, which no reader survives, and times in whole seconds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace booth::daemon {

/// The same nodes with every list of children ended and all offsets right, key times divided by `time_divisor` and the animation ending `stop` after its
/// start (both in FBX's unit of time, 46,186,158,000 to the second). Nothing when the bytes are no binary FBX 7.5 (64-bit offsets).
std::optional<std::string> repair_fbx(std::string_view bytes, std::int64_t time_divisor, std::int64_t stop);

}  // namespace booth::daemon
