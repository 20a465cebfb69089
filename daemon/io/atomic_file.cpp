// The order of system calls that survives a power cut: write, fsync file, rename, fsync folder.
#include "daemon/io/atomic_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "daemon/seal/seal.hpp"

namespace booth::daemon {
namespace {

constexpr std::size_t kBufferBytes = kSealChunk;

std::filesystem::path folder_of(const std::filesystem::path& path) { return path.has_parent_path() ? path.parent_path() : std::filesystem::path("."); }

}  // namespace

AtomicFile::AtomicFile(const FileTarget& target, mode_t mode) : path_(target.path) {
  if (target.seal) {
    encoder_ = std::make_unique<SealEncoder>(*target.seal, path_.filename().string());
    path_ += kSealedEnding;
    mode = 0600;
  }
  temporary_ = path_.string() + ".XXXXXX.part";
  buffer_.reserve(kBufferBytes);
  constexpr int kSuffixLength = 5;  // ".part"
  fd_ = ::mkostemps(temporary_.data(), kSuffixLength, O_CLOEXEC);
  if (fd_ < 0) fail("create");
  if (::fchmod(fd_, mode) != 0) {
    const int reason = errno;
    ::close(fd_);
    ::unlink(temporary_.c_str());
    errno = reason;
    fail("set the mode of");
  }
}

AtomicFile::~AtomicFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

void AtomicFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t part = std::min(bytes.size(), kBufferBytes - buffer_.size());
    buffer_.append(bytes.substr(0, part));
    bytes.remove_prefix(part);
    if (buffer_.size() == kBufferBytes) flush();
  }
}

void AtomicFile::flush() {
  if (encoder_) {
    if (!buffer_.empty()) seal_buffer(false);
    return;
  }
  write_out(buffer_);
  buffer_.clear();
}

void AtomicFile::seal_buffer(bool last) {
  sealed_.clear();
  encoder_->append(buffer_, last, sealed_);
  buffer_.clear();
  write_out(sealed_);
}

void AtomicFile::write_out(const std::string& bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::write(fd_, bytes.data() + done, bytes.size() - done);
    if (n < 0) {
      if (errno == EINTR) continue;
      fail("write");
    }
    done += static_cast<std::size_t>(n);
  }
}

void AtomicFile::commit() {
  if (encoder_)
    seal_buffer(true);
  else
    flush();
  if (::fsync(fd_) != 0) fail("flush");
  const int fd = fd_;
  fd_ = -1;
  if (::close(fd) != 0 || ::rename(temporary_.c_str(), path_.c_str()) != 0) {
    const int reason = errno;
    ::unlink(temporary_.c_str());
    errno = reason;
    fail("put in place");
  }
  // Without this the new name may be lost with the power although the contents are safe.
  if (const int reason = sync_folder(folder_of(path_)); reason != 0) {
    errno = reason;
    fail("flush the folder of");
  }
}

int sync_folder(const std::filesystem::path& folder) noexcept {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return errno;
  const int reason = ::fsync(fd) == 0 ? 0 : errno;
  ::close(fd);
  // Some file systems (network mounts among them) cannot fsync a folder and say so with EINVAL; there is nothing more to do on those.
  return reason == EINVAL ? 0 : reason;
}

void AtomicFile::fail(const char* doing) const {
  const int reason = errno;
  std::string text = "cannot " + std::string(doing) + " " + path_.string() + ": " + std::strerror(reason);
  if (reason == ENOENT) text += " (does the folder " + folder_of(path_).string() + " exist?)";
  if (reason == EACCES || reason == EROFS) text += "; choose a folder that can be written";
  if (reason == ENOSPC || reason == EDQUOT) text += "; free some space and try again";
  throw std::runtime_error(text);
}

void write_file_atomically(const FileTarget& target, std::string_view contents, mode_t mode) {
  AtomicFile file(target, mode);
  file.write(contents);
  file.commit();
}

}  // namespace booth::daemon
