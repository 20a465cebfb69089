// Files that are whole or not there: written under a temporary name, flushed to stable storage, then renamed.
#pragma once

#include <sys/types.h>

#include <concepts>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace booth::daemon {

class Seal;
class SealEncoder;

/// Where a file goes: a path, and where a seal is given, PATH.sealed, which only the holder of the private key can read. The seal outlives the target.
struct FileTarget {
  template <std::convertible_to<std::filesystem::path> Path>
  FileTarget(Path&& p, const Seal* s = nullptr) : path(std::forward<Path>(p)), seal(s) {}  // a plain path is a target
  std::filesystem::path path;
  const Seal* seal = nullptr;
};

/// One file being written. The temporary file stands in the same folder as the final one ("NAME.XXXXXX.part"), so that the rename is atomic.
/// Not thread-safe. All members but the destructor throw std::runtime_error naming the path and the system's reason.
class AtomicFile {
 public:
  /// Creates the temporary file; the folder must exist. `mode` is what the final file gets (umask does not widen it); a sealed one gets 0600.
  explicit AtomicFile(const FileTarget& target, mode_t mode = 0644);
  /// Removes the temporary file when commit() was not reached.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends; buffered.
  void write(std::string_view bytes);
  /// Hands what is buffered to the kernel, for files that grow over minutes.
  void flush();
  /// Flushes, fsyncs the file, renames it over `path` and fsyncs the folder.
  void commit();

 private:
  [[noreturn]] void fail(const char* doing) const;
  void write_out(const std::string& bytes);
  /// Of a sealed file: what is buffered becomes a chunk.
  void seal_buffer(bool last);

  std::filesystem::path path_;
  std::string temporary_;
  std::string buffer_, sealed_;
  std::unique_ptr<SealEncoder> encoder_;
  int fd_ = -1;
};

/// Brings the names in a folder to stable storage; without this what was made or renamed in it may be gone with the power. Returns 0 or the system's reason.
int sync_folder(const std::filesystem::path& folder) noexcept;

/// The whole life of an AtomicFile for contents that are already in memory.
void write_file_atomically(const FileTarget& target, std::string_view contents, mode_t mode = 0644);

}  // namespace booth::daemon
