// Waiting for one line with a time limit.
#include "daemon/ctl/control_client.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <stdexcept>

#include "daemon/config/load.hpp"

namespace booth::daemon {

std::string ControlClient::ask(const std::string& line, std::chrono::milliseconds limit) {
  if (!send_all(fd_.get(), line + "\n", limit)) throw std::runtime_error("boothd closed the connection");
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (true) {
    if (const auto end = pending_.find('\n'); end != std::string::npos) {
      std::string answer = pending_.substr(0, end);
      pending_.erase(0, end + 1);
      return answer;
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd wait{fd_.get(), POLLIN, 0};
    if (left.count() <= 0 || ::poll(&wait, 1, static_cast<int>(left.count())) == 0) throw std::runtime_error("boothd does not answer");
    char buffer[4096];
    const ssize_t n = ::recv(fd_.get(), buffer, sizeof buffer, 0);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) throw std::runtime_error("boothd closed the connection");
    pending_.append(buffer, static_cast<std::size_t>(n));
  }
}

std::filesystem::path control_socket_path(const std::string& given) { return given.empty() ? load_what_is_right({}).control.socket : given; }

}  // namespace booth::daemon
