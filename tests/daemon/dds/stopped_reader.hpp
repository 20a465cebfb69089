// A subscriber that hangs: a process that reads everything of a booth and is stopped when it has been found.
#pragma once

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

#include "tests/daemon/dds/peer.hpp"

namespace booth::tests {

/// Of booth `b` in test_domain(); killed with its end.
class StoppedReader {
 public:
  /// `also`: "ros2" for the topics of the ROS 2 mirror besides; nullptr for none.
  explicit StoppedReader(const char* also = nullptr) {
    int ready[2];
    if (::pipe(ready) != 0) return;
    const std::uint32_t domain = test_domain();  // the child's number is another
    pid_ = ::fork();
    if (pid_ == 0) {
      ::execl(BOOTH_BINARY_DIR "/bin/booth-simulated-reader", "reader", std::to_string(domain).c_str(), "b", std::to_string(ready[1]).c_str(), also, nullptr);
      ::_exit(127);
    }
    ::close(ready[1]);
    char byte = 0;
    found = ::read(ready[0], &byte, 1) == 1;
    ::close(ready[0]);
    if (pid_ > 0) ::kill(pid_, SIGSTOP);
  }
  StoppedReader(const StoppedReader&) = delete;
  StoppedReader& operator=(const StoppedReader&) = delete;
  ~StoppedReader() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  bool found = false;

 private:
  pid_t pid_ = -1;
};

}  // namespace booth::tests
