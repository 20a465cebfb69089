// Opening, listening on and writing to Unix sockets.
#include "daemon/ctl/unix_socket.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace booth::daemon {
namespace {

constexpr std::chrono::seconds kConnectLimit{2};

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.empty() || text.size() >= sizeof address.sun_path) throw std::runtime_error(fmt::format("{}: a socket's path has 1 to 107 bytes", text));
  std::memcpy(address.sun_path, text.data(), text.size());
  return address;
}

UniqueFd make_socket(const std::filesystem::path& path) {
  UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!fd) throw std::runtime_error(fmt::format("{}: cannot make a socket: {}", path.string(), std::strerror(errno)));
  // connect() waits for as long as the queue of a program that hangs is full: for ever, where nothing limits it. EAGAIN says then that the time is over.
  const timeval limit{.tv_sec = kConnectLimit.count(), .tv_usec = 0};
  (void)::setsockopt(fd.get(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  return fd;
}

bool try_connect(int fd, const sockaddr_un& address) {
  int result;
  do {
    result = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  } while (result != 0 && errno == EINTR);
  return result == 0;
}

}  // namespace

void UniqueFd::reset() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

UniqueFd listen_unix(const std::filesystem::path& path) {
  const sockaddr_un address = address_of(path);
  struct stat info {};
  if (::lstat(path.c_str(), &info) == 0) {
    if (!S_ISSOCK(info.st_mode))
      throw std::runtime_error(fmt::format("{}: is there already and is not a socket; remove it or set control.socket", path.string()));
    const UniqueFd probe = make_socket(path);
    if (try_connect(probe.get(), address) || errno == EAGAIN)
      throw std::runtime_error(fmt::format("{}: another boothd is running on this socket", path.string()));
    ::unlink(path.c_str());
  } else if (path.has_parent_path()) {
    std::error_code ignored;
    std::filesystem::create_directories(path.parent_path(), ignored);
  }
  UniqueFd fd = make_socket(path);
  // The mode must be right from the first moment: bind() makes the file with what the mask leaves.
  const mode_t old = ::umask(0117);
  const int bound = ::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int reason = errno;
  ::umask(old);
  if (bound != 0 || ::listen(fd.get(), 16) != 0)
    throw std::runtime_error(fmt::format("{}: cannot listen: {} (is the folder there and writable? the key is control.socket)", path.string(),
                                         std::strerror(bound != 0 ? reason : errno)));
  return fd;
}

UniqueFd connect_unix(const std::filesystem::path& path) {
  const sockaddr_un address = address_of(path);
  UniqueFd fd = make_socket(path);
  if (try_connect(fd.get(), address)) return fd;
  switch (errno) {
    case ENOENT:
    case ECONNREFUSED:
      throw std::runtime_error(fmt::format("boothd is not running (nobody listens on {})", path.string()));
    case EAGAIN:
      throw std::runtime_error(fmt::format("boothd does not answer (whoever listens on {} takes no connection)", path.string()));
    case EACCES:
      throw std::runtime_error(fmt::format("{}: permission denied; are you in the group boothd?", path.string()));
    default:
      throw std::runtime_error(fmt::format("{}: cannot connect: {}", path.string(), std::strerror(errno)));
  }
}

bool send_all(int fd, std::string_view text, std::chrono::milliseconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!text.empty()) {
    const ssize_t n = ::send(fd, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      text.remove_prefix(static_cast<std::size_t>(n));
      continue;
    }
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK) return false;
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd wait{fd, POLLOUT, 0};
    if (left.count() <= 0 || ::poll(&wait, 1, static_cast<int>(left.count())) <= 0) return false;
  }
  return true;
}

}  // namespace booth::daemon
