// What boothd may ask of the kernel once it has started: a list that was measured, without programs, new sockets or code; whatever else is refused and named.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace booth::daemon {

/// While it lives a thread answers for the kernel: a system call that is not in the list returns EPERM to whoever made it, and is told. Afterwards it returns
/// ENOSYS, untold: nothing widens the list again for this process.
class SystemCallGuard {
 public:
  /// Name as in the manual ("execve"), number, and the thread that tried. Called on the guard's own thread; must make no system call that is not in the list.
  using Refused = std::function<void(const std::string& name, int number, std::uint32_t thread)>;

  /// Holds for all threads of the process, those that exist and those to come. Throws std::runtime_error where this kernel cannot (it needs Linux 5.7 with
  /// seccomp), and changes nothing then.
  explicit SystemCallGuard(Refused refused);
  ~SystemCallGuard();
  SystemCallGuard(const SystemCallGuard&) = delete;

 private:
  class Watch;
  std::unique_ptr<Watch> watch_;
};

}  // namespace booth::daemon
