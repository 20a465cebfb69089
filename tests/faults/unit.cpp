// The little of systemd that boothd's unit relies on: the notify socket, the watchdog's signals, the pause before another start.
#include "tests/faults/unit.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {

using namespace std::chrono_literals;

Unit::Unit(std::vector<std::string> command, std::filesystem::path folder, UnitRules rules)
    : command_(std::move(command)), folder_(std::move(folder)), rules_(std::move(rules)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = (folder_ / "notify").string();
  if (path.size() >= sizeof address.sun_path) throw std::runtime_error(path + ": too long for a socket; choose a shorter TMPDIR");
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  ::unlink(path.c_str());
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket_ < 0 || ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw std::runtime_error(path + ": cannot be listened on: " + std::strerror(errno));
  thread_ = std::thread([this] { run(); });
}

Unit::~Unit() {
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  thread_.join();
  if (state_.pid > 0) {
    ::kill(state_.pid, SIGKILL);
    ::waitpid(state_.pid, nullptr, 0);
  }
  ::close(socket_);
}

void Unit::start() {
  const std::lock_guard lock(mutex_);
  wanted_ = true;
  state_.failed = false;
  start_at_ = Clock::now();
}

bool Unit::stop(std::chrono::seconds limit) {
  {
    const std::lock_guard lock(mutex_);
    wanted_ = false;
    if (state_.pid > 0) ::kill(state_.pid, SIGTERM);
  }
  if (!eventually([&] { return state().pid < 0; }, limit)) return false;
  const int status = state().last_status;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

Unit::State Unit::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

bool Unit::wait_ready(std::uint64_t starts, std::chrono::seconds limit) const {
  return eventually(
      [&] {
        const State now = state();
        return now.starts > starts && now.ready;
      },
      limit);
}

std::string Unit::log() const { return read_text(folder_ / "boothd.log"); }

void Unit::spawn() {
  std::vector<char*> argv;
  for (const auto& word : command_) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  const std::string notify = (folder_ / "notify").string(), log = (folder_ / "boothd.log").string();
  const std::string limit = std::to_string(std::chrono::microseconds(rules_.watchdog).count());
  // This thread must outlive the child: the kernel ends it with the thread that made it.
  const pid_t pid = ::fork();
  if (pid == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const rlimit no_core{0, 0};  // LimitCORE=0
    ::setrlimit(RLIMIT_CORE, &no_core);
    ::setenv("NOTIFY_SOCKET", notify.c_str(), 1);
    ::setenv("WATCHDOG_USEC", limit.c_str(), 1);
    ::unsetenv("WATCHDOG_PID");
    const int fd = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    ::dup2(fd, STDOUT_FILENO);
    ::dup2(fd, STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  state_.pid = pid;
  ++state_.starts;
  state_.ready = false;
  last_ping_ = Clock::now();
  abort_at_ = {};
}

void Unit::run() {
  while (true) {
    pollfd wait{socket_, POLLIN, 0};
    ::poll(&wait, 1, 10);
    const std::lock_guard lock(mutex_);
    if (end_) return;
    take_notes();
    take_end();
    mind_watchdog();
    if (wanted_ && state_.pid < 0 && !state_.failed && Clock::now() >= start_at_) spawn();
  }
}

void Unit::take_notes() {
  char text[4096];
  for (ssize_t n = 0; (n = ::recv(socket_, text, sizeof text - 1, 0)) > 0;) {
    text[n] = 0;
    if (std::strstr(text, "READY=1") && !state_.ready) {
      state_.ready = true;
      state_.ready_at = last_ping_ = Clock::now();
    }
    if (std::strstr(text, "WATCHDOG=1")) last_ping_ = Clock::now();
  }
}

void Unit::take_end() {
  int status = 0;
  if (state_.pid < 0 || ::waitpid(state_.pid, &status, WNOHANG) != state_.pid) return;
  state_.pid = -1;
  state_.ready = false;
  state_.last_status = status;
  const bool asked = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  const bool hopeless = WIFEXITED(status) && std::count(rules_.no_restart.begin(), rules_.no_restart.end(), WEXITSTATUS(status)) > 0;
  if (wanted_ && (asked || hopeless)) state_.failed = true;
  start_at_ = Clock::now() + rules_.restart;
}

void Unit::mind_watchdog() {
  // systemd looks at the watchdog of a service that runs only; one that was told to stop has TimeoutStopSec for it.
  if (state_.pid < 0 || !state_.ready || !wanted_) return;
  const auto now = Clock::now();
  if (abort_at_ == Clock::time_point{} && now - last_ping_ > rules_.watchdog) {
    ++state_.watchdogs;
    abort_at_ = now;
    ::kill(state_.pid, SIGABRT);
    ::kill(state_.pid, SIGCONT);  // a stopped process hears nothing else
  } else if (abort_at_ != Clock::time_point{} && now - abort_at_ > rules_.abort) {
    ::kill(state_.pid, SIGKILL);
  }
}

}  // namespace booth::tests
