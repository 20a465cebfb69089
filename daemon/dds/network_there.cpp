// The kernel's list of interfaces with an IPv4 address, by ioctl: of all ways to ask the one that needs no new socket.
#include "daemon/dds/network_there.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace booth::daemon {
namespace {

constexpr std::size_t kMostInterfaces = 64;

std::string address_of(const ifreq& entry) {
  sockaddr_in address{};
  std::memcpy(&address, &entry.ifr_addr, sizeof address);
  std::array<char, INET_ADDRSTRLEN> text{};
  return address.sin_family == AF_INET && ::inet_ntop(AF_INET, &address.sin_addr, text.data(), text.size()) ? text.data() : "";
}

}  // namespace

NetworkThere::NetworkThere(std::string interface) : interface_(std::move(interface)), socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  if (socket_ < 0) throw std::runtime_error(fmt::format("DDS: the interfaces of the network cannot be listed: {}", std::strerror(errno)));
}

NetworkThere::~NetworkThere() { ::close(socket_); }

bool NetworkThere::there() const {
  if (interface_.find(':') != std::string::npos) return true;
  std::array<ifreq, kMostInterfaces> entries{};
  ifconf list{};
  list.ifc_len = sizeof entries;
  list.ifc_req = entries.data();
  if (::ioctl(socket_, SIOCGIFCONF, &list) != 0) return true;
  const std::size_t count = static_cast<std::size_t>(list.ifc_len) / sizeof(ifreq);
  for (std::size_t i = 0; i < count; ++i) {
    ifreq flags = entries[i];
    const std::string name(entries[i].ifr_name, ::strnlen(entries[i].ifr_name, IFNAMSIZ));
    if (::ioctl(socket_, SIOCGIFFLAGS, &flags) != 0 || (flags.ifr_flags & IFF_UP) == 0) continue;
    // Any that carries something: an interface without a cable may be up and have an address, too.
    const bool wanted =
        interface_.empty() ? (flags.ifr_flags & (IFF_LOOPBACK | IFF_RUNNING)) == IFF_RUNNING : interface_ == name || interface_ == address_of(entries[i]);
    if (wanted) return true;
  }
  return false;
}

std::string NetworkThere::sentence() const {
  return interface_.empty() ? "DDS: this machine has no network yet: nobody on another one hears this booth; when there is one, boothd begins anew"
                            : fmt::format(
                                  "DDS: there is no interface {} that is up and has an address: nobody hears this booth; when there is one, boothd "
                                  "begins anew",
                                  interface_);
}

}  // namespace booth::daemon
