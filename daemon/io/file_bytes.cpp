// Plain system calls: a stream would hide the reason why a file cannot be read.
#include "daemon/io/file_bytes.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace booth::daemon {
namespace {

struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& why) { throw std::runtime_error("cannot read " + path.string() + ": " + why); }

}  // namespace

std::string read_file_bytes(const std::filesystem::path& path, std::uint64_t most) {
  // Non-blocking: opening a pipe that nobody writes to must not hang; regular files do not care.
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (file.fd < 0) fail(path, std::strerror(errno));
  struct stat status {};
  if (::fstat(file.fd, &status) != 0) fail(path, std::strerror(errno));
  if (S_ISDIR(status.st_mode)) fail(path, "it is a folder");
  if (!S_ISREG(status.st_mode)) fail(path, "it is not a regular file");
  const auto too_large = [&](std::uint64_t size) {
    fail(path, "it has " + std::to_string(size) + " bytes, at most " + std::to_string(most) + " are accepted");
  };
  const auto size = static_cast<std::uint64_t>(status.st_size);
  if (size > most) too_large(size);
  // One byte more than it says: only the end of the file proves that nothing is missing.
  std::string bytes(size + 1, '\0');
  std::size_t done = 0;
  while (true) {
    const ssize_t n = ::read(file.fd, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path, std::strerror(errno));
    if (n == 0) break;  // or it shrank while being read; the parser will say what is missing
    done += static_cast<std::size_t>(n);
    if (done > most) too_large(done);
    if (done == bytes.size()) bytes.resize(2 * done);  // it grows, or the kernel makes it while it is read
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace booth::daemon
