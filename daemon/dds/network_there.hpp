// Whether the network that DDS is to speak on is there: after a power cut a box is often up before the switch that it hangs on.
#pragma once

#include <string>

namespace booth::daemon {

/// Holds a socket from its construction on, so that it can still be asked when boothd may make no more. Not thread-safe.
class NetworkThere {
 public:
  /// `interface` as in dds.interface: a name, an IPv4 address, or empty: any but loopback that has a carrier. Throws std::runtime_error where no socket can be
  /// made.
  explicit NetworkThere(std::string interface);
  ~NetworkThere();
  NetworkThere(const NetworkThere&) = delete;

  /// An interface of that name or address is up and has an IPv4 address, which is what the library looks for once, when the domain is opened. What cannot be
  /// judged (IPv6) is taken to be there.
  bool there() const;
  /// What is missing, and what comes of it; short, because it has to fit into a status.
  std::string sentence() const;

 private:
  const std::string interface_;
  const int socket_;
};

}  // namespace booth::daemon
