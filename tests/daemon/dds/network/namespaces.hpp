// A network of one's own for a process: an empty namespace with interfaces whose cables end in file descriptors.
#pragma once

#include <string>

namespace booth::tests {

/// Moves this process (of one thread) into a network namespace of its own, where it is root. Returns what forbids it, empty when it worked.
std::string enter_own_network();

/// An Ethernet interface that is up, with `address`/24; what it sends is read from the descriptor, and what is written there it receives. Throws
/// std::runtime_error naming the step.
int open_cable(const std::string& interface, const std::string& address);

/// Descriptors over a Unix socket.
bool send_descriptor(int socket, int descriptor);
int receive_descriptor(int socket);

}  // namespace booth::tests
