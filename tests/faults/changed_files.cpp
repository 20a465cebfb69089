// One byte at a time, and each program in a process of its own.
#include "tests/faults/changed_files.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

int wait_for(pid_t pid, std::chrono::seconds limit) {
  int status = 0;
  if (!eventually([&] { return ::waitpid(pid, &status, WNOHANG) == pid; }, limit)) {
    ::kill(pid, SIGKILL);
    ::waitpid(pid, &status, 0);
    return -1;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void no_core() {
  const rlimit none{0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
}

}  // namespace

void with_each_region_changed(const std::filesystem::path& file, int regions, std::mt19937_64& random, const std::function<void(std::size_t)>& look) {
  const std::string whole = read_text(file);
  const std::size_t parts = std::min<std::size_t>(static_cast<std::size_t>(regions), whole.size());
  for (std::size_t part = 0; part < parts; ++part) {
    const std::size_t from = part * whole.size() / parts, to = (part + 1) * whole.size() / parts;
    const std::size_t at = std::uniform_int_distribution<std::size_t>(from, to - 1)(random);
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ static_cast<char>(std::uniform_int_distribution(1, 255)(random)));
    std::ofstream(file, std::ios::binary) << changed;
    look(at);
  }
  std::ofstream(file, std::ios::binary) << whole;
}

Ended run_program(std::vector<std::string> command, const std::filesystem::path& output, std::chrono::seconds limit) {
  std::vector<char*> argv;
  for (auto& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t pid = ::fork();
  if (pid == 0) {
    no_core();
    const int fd = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(fd, STDOUT_FILENO);
    ::dup2(fd, STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  Ended out;
  if (pid < 0) return out;
  out.status = wait_for(pid, limit);
  out.output = read_text(output);
  return out;
}

Ended run_apart(const std::function<int()>& work, std::chrono::seconds limit) {
  const pid_t pid = ::fork();
  if (pid == 0) {
    no_core();
    int status = 99;
    try {
      status = work();
    } catch (...) {
    }
    ::_exit(status);
  }
  Ended out;
  if (pid > 0) out.status = wait_for(pid, limit);
  return out;
}

}  // namespace booth::tests
