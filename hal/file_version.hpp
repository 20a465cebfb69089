// One rule for every file that outlives the program that wrote it: an update can be taken back, and what it wrote in the meantime is still read.
#pragma once

#include <cstdint>
#include <string>

namespace booth::hal {

enum class FileVersion : std::uint8_t { readable, newer, unreadable };

/// `known` is what this program writes. It reads what the program before it wrote, and what the next one will write: a version is raised by one at a time, and
/// between neighbours only things are added, which the older program passes over with a warning (`newer`). Thread-safe.
constexpr FileVersion judge_file_version(std::int64_t found, std::int64_t known) {
  if (found < 1 || found < known - 1 || found > known + 1) return FileVersion::unreadable;
  return found > known ? FileVersion::newer : FileVersion::readable;
}

/// The end of a sentence that begins with the file's name: for a warning, or for an error.
inline std::string file_version_complaint(std::int64_t found, std::int64_t known) {
  const std::string what = "is of version " + std::to_string(found) + ", this program writes " + std::to_string(known);
  return judge_file_version(found, known) == FileVersion::unreadable ? what + " and reads its neighbours; use the boothd that wrote it, or make the file anew"
                                                                     : what + "; what it does not know is passed over";
}

}  // namespace booth::hal
