// Files that are whole or not there: written under a temporary name, flushed to stable storage, then renamed.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace booth::daemon {

/// One file being written. The temporary file stands in the same folder as the final one ("NAME.XXXXXX.part"), so that the rename is atomic.
/// Not thread-safe. All members but the destructor throw std::runtime_error naming the path and the system's reason.
class AtomicFile {
 public:
  /// Creates the temporary file; the folder must exist. `mode` is what the final file gets (umask does not widen it).
  explicit AtomicFile(std::filesystem::path path, mode_t mode = 0644);
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

  std::filesystem::path path_;
  std::string temporary_;
  std::string buffer_;
  int fd_ = -1;
};

/// The whole life of an AtomicFile for contents that are already in memory.
void write_file_atomically(const std::filesystem::path& path, std::string_view contents, mode_t mode = 0644);

}  // namespace booth::daemon
