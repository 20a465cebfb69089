// Reading a whole file with a limit, so that every parser works on memory whose size is known.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace booth::daemon {

/// All bytes of a regular file. Throws std::runtime_error naming the path and why: missing, a folder, unreadable, or more than `most` bytes.
std::string read_file_bytes(const std::filesystem::path& path, std::uint64_t most);

}  // namespace booth::daemon
