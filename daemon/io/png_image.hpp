// Pictures to PNG files.
#pragma once

#include <filesystem>

#include "daemon/io/picture.hpp"

namespace booth::daemon {

/// 8-bit RGB PNG through AtomicFile. Throws std::runtime_error naming the path and the reason.
void write_png(const std::filesystem::path& path, const Picture& picture);

}  // namespace booth::daemon
