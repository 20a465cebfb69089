// How much room there is where something will be written, which may not be there yet.
#pragma once

#include <cstdint>
#include <filesystem>

namespace booth::daemon {

/// Bytes; negative: not known.
struct DiskSpace {
  std::int64_t free = -1;  ///< to this user, who may not have what is kept for root
  std::int64_t total = -1;
};

/// Of the disk that holds `folder`, or the nearest folder above it that exists. Thread-safe; waits as long as the disk does.
DiskSpace disk_space(std::filesystem::path folder);

}  // namespace booth::daemon
