// Where a driver puts what not even this machine may read again: how it is closed is not the driver's business.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace booth::hal {

/// One growing file that only the holder of a key elsewhere can read. Not thread-safe. All but bytes() throw std::runtime_error naming the file and the
/// reason; after that the file ends with what was whole before, and close() leaves it so.
class SealedFile {
 public:
  virtual ~SealedFile() = default;
  /// Buffered; what comes out at the other end are the same bytes, not the same pieces.
  virtual void append(std::span<const std::byte> bytes) = 0;
  /// To stable storage: a reader gets everything up to here, whatever happens next.
  virtual void flush() = 0;
  /// flush(), and the mark that nothing is missing.
  virtual void close() = 0;
  virtual std::uint64_t bytes() const = 0;  ///< on the disk
};

/// Begins such a file of that name in a folder, in which there must be none yet.
using SealFiles = std::function<std::unique_ptr<SealedFile>(const std::filesystem::path& folder, const std::string& name)>;

}  // namespace booth::hal
