// One call of the kernel, for the first folder that is there.
#include "daemon/io/disk_space.hpp"

#include <sys/statvfs.h>

namespace booth::daemon {

DiskSpace disk_space(std::filesystem::path folder) {
  struct statvfs disk {};
  while (::statvfs(folder.c_str(), &disk) != 0) {
    if (folder.empty() || folder == folder.parent_path()) return {};
    folder = folder.parent_path();
  }
  return {.free = static_cast<std::int64_t>(disk.f_bavail) * static_cast<std::int64_t>(disk.f_frsize),
          .total = static_cast<std::int64_t>(disk.f_blocks) * static_cast<std::int64_t>(disk.f_frsize)};
}

}  // namespace booth::daemon
