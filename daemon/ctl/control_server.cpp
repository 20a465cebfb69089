// One poll() loop over a handful of clients.
#include "daemon/ctl/control_server.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>

namespace booth::daemon {
namespace {
constexpr std::chrono::milliseconds kSendLimit(500);
constexpr int kDeaf = 100;  ///< milliseconds
}  // namespace

ControlServer::ControlServer(std::filesystem::path path, std::function<std::string(const std::string&)> answer)
    : ControlServer(path, listen_unix(path), std::move(answer)) {}

ControlServer::ControlServer(std::filesystem::path path, UniqueFd listener, std::function<std::string(const std::string&)> answer,
                             std::chrono::milliseconds silence)
    : path_(std::move(path)), answer_(std::move(answer)), silence_(silence), listener_(std::move(listener)), wake_(::eventfd(0, EFD_CLOEXEC)) {
  if (!wake_) throw std::runtime_error("cannot make an eventfd");
  thread_ = std::thread([this] { serve(); });
}

ControlServer::~ControlServer() {
  const std::uint64_t one = 1;
  while (::write(wake_.get(), &one, sizeof one) < 0 && errno == EINTR) {
  }
  thread_.join();
  ::unlink(path_.c_str());
}

void ControlServer::accept_client() {
  UniqueFd fd(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (!fd) {
    // The knock stays, and poll() would return at once, again and again.
    deaf_ = errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
    return;
  }
  if (clients_.size() >= kMostClients && !make_room()) {
    send_all(fd.get(), "{\"ok\":false,\"error\":\"too many clients\"}\n", std::chrono::milliseconds(10));
    return;
  }
  clients_.push_back({.fd = std::move(fd), .pending = {}});
}

bool ControlServer::make_room() {
  const auto quietest = std::min_element(clients_.begin(), clients_.end(), [](const Client& a, const Client& b) { return a.heard < b.heard; });
  if (std::chrono::steady_clock::now() - quietest->heard < silence_) return false;
  clients_.erase(quietest);
  return true;
}

bool ControlServer::read_client(Client& client) {
  char buffer[1024];
  const ssize_t n = ::recv(client.fd.get(), buffer, sizeof buffer, MSG_DONTWAIT);
  if (n == 0) return false;
  if (n < 0) return errno == EAGAIN || errno == EINTR;
  client.heard = std::chrono::steady_clock::now();
  client.pending.append(buffer, static_cast<std::size_t>(n));
  for (std::size_t end; (end = client.pending.find('\n')) != std::string::npos;) {
    const std::string line = client.pending.substr(0, end);
    client.pending.erase(0, end + 1);
    if (!send_all(client.fd.get(), answer_(line) + "\n", kSendLimit)) return false;
  }
  if (client.pending.size() <= kLongestLine) return true;
  send_all(client.fd.get(), fmt::format("{{\"ok\":false,\"error\":\"a request has at most {} bytes\"}}\n", kLongestLine), kSendLimit);
  return false;
}

void ControlServer::serve() {
  while (true) {
    std::vector<pollfd> watch{{wake_.get(), POLLIN, 0}, {deaf_ ? -1 : listener_.get(), POLLIN, 0}};
    for (const Client& client : clients_) watch.push_back({client.fd.get(), POLLIN, 0});
    const int ready = ::poll(watch.data(), watch.size(), deaf_ ? kDeaf : -1);
    deaf_ = false;
    if (ready < 0) continue;
    if (watch[0].revents) return;
    // Backwards, so that those still to be looked at keep their places.
    for (std::size_t i = clients_.size(); i-- > 0;) {
      if (watch[i + 2].revents && !read_client(clients_[i])) clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    if (watch[1].revents) accept_client();
  }
}

}  // namespace booth::daemon
