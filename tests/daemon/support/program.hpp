// boothd and boothctl as child processes, for tests that want the programs and not their parts.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {

/// A child process: one of ours by name, or any other by its path. What it prints is in files of its own, `output`.out and `output`.err; killed with its end.
class Program {
 public:
  Program(const std::string& name, std::vector<std::string> arguments, std::filesystem::path output) : output_(std::move(output)) {
    arguments.insert(arguments.begin(), name.find('/') == std::string::npos ? BOOTH_BINARY_DIR "/bin/" + name : name);
    std::vector<char*> argv;
    for (auto& a : arguments) argv.push_back(a.data());
    argv.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(::open(file(".out").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDOUT_FILENO);
      ::dup2(::open(file(".err").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
  }
  ~Program() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  void signal(int s) const {
    if (pid_ > 0) ::kill(pid_, s);
  }
  /// Exit status, -1 when it was killed or does not end in time.
  int wait(std::chrono::seconds limit = std::chrono::seconds(60)) {
    int status = 0;
    if (!eventually([&] { return ::waitpid(pid_, &status, WNOHANG) == pid_; }, limit)) return -1;
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string out() const { return read_text(file(".out")); }
  std::string err() const { return read_text(file(".err")); }
  /// Both, for tests that do not care which.
  std::string output() const { return out() + err(); }

 private:
  std::string file(const char* ending) const { return output_.string() + ending; }

  std::filesystem::path output_;
  pid_t pid_ = -1;
};

}  // namespace booth::tests
