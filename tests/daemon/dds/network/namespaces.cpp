// unshare, TAP devices and the ioctls that bring them up; nothing here needs privileges where user namespaces are allowed.
#include "tests/daemon/dds/network/namespaces.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace booth::tests {
namespace {

void request(int fd, unsigned long what, void* argument, const char* step) {
  if (::ioctl(fd, what, argument) != 0) throw std::runtime_error(std::string(step) + ": " + std::strerror(errno));
}

ifreq named(const std::string& interface) {
  ifreq r{};
  std::strncpy(r.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  return r;
}

void set_address(int fd, const std::string& interface, unsigned long what, const char* address) {
  ifreq r = named(interface);
  sockaddr_in in{};
  in.sin_family = AF_INET;
  ::inet_pton(AF_INET, address, &in.sin_addr);
  std::memcpy(&r.ifr_addr, &in, sizeof in);
  request(fd, what, &r, "setting an address");
}

void bring_up(int fd, const std::string& interface) {
  ifreq r = named(interface);
  request(fd, SIOCGIFFLAGS, &r, "reading flags");
  r.ifr_flags = static_cast<short>(r.ifr_flags | IFF_UP | IFF_RUNNING | IFF_MULTICAST);
  request(fd, SIOCSIFFLAGS, &r, "bringing an interface up");
}

}  // namespace

std::string enter_own_network() {
  if (::access("/dev/net/tun", R_OK | W_OK) != 0) return "/dev/net/tun cannot be opened";
  // Root needs no user namespace; everybody else is root in one of his own.
  const int flags = ::geteuid() == 0 ? CLONE_NEWNET : CLONE_NEWUSER | CLONE_NEWNET;
  if (::unshare(flags) != 0) return std::string("a network namespace of its own is not permitted: ") + std::strerror(errno);
  return "";
}

int open_cable(const std::string& interface, const std::string& address) {
  const int tap = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (tap < 0) throw std::runtime_error(std::string("/dev/net/tun: ") + std::strerror(errno));
  ifreq r = named(interface);
  r.ifr_flags = IFF_TAP | IFF_NO_PI;
  request(tap, TUNSETIFF, &r, "making an interface");
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  bring_up(fd, "lo");
  set_address(fd, interface, SIOCSIFADDR, address.c_str());
  set_address(fd, interface, SIOCSIFNETMASK, "255.255.255.0");
  bring_up(fd, interface);
  ::close(fd);
  return tap;
}

bool send_descriptor(int socket, int descriptor) {
  char byte = '!';
  iovec data{&byte, 1};
  alignas(cmsghdr) char space[CMSG_SPACE(sizeof(int))] = {};
  msghdr message{};
  message.msg_iov = &data, message.msg_iovlen = 1;
  message.msg_control = space, message.msg_controllen = sizeof space;
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET, header->cmsg_type = SCM_RIGHTS, header->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(header), &descriptor, sizeof descriptor);
  return ::sendmsg(socket, &message, 0) == 1;
}

int receive_descriptor(int socket) {
  char byte = 0;
  iovec data{&byte, 1};
  alignas(cmsghdr) char space[CMSG_SPACE(sizeof(int))] = {};
  msghdr message{};
  message.msg_iov = &data, message.msg_iovlen = 1;
  message.msg_control = space, message.msg_controllen = sizeof space;
  if (::recvmsg(socket, &message, MSG_CMSG_CLOEXEC) != 1) return -1;
  const cmsghdr* header = CMSG_FIRSTHDR(&message);
  int out = -1;
  if (header && header->cmsg_type == SCM_RIGHTS) std::memcpy(&out, CMSG_DATA(header), sizeof out);
  return out;
}

}  // namespace booth::tests
