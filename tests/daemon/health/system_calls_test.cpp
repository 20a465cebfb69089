// After the guard: what boothd does goes on, what it never does is refused and named, in every thread.
#include "daemon/health/system_calls.hpp"

#include <errno.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Runs `body` in a child, because a filter cannot be taken off again; returns what it said.
template <class F>
std::string in_child(F body) {
  int ends[2];
  if (::pipe(ends) != 0) return "no pipe";
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(ends[0]);
    const std::string said = body();
    (void)!::write(ends[1], said.data(), said.size());
    ::_exit(0);
  }
  ::close(ends[1]);
  std::string out;
  char part[512];
  for (ssize_t n; (n = ::read(ends[0], part, sizeof part)) > 0;) out.append(part, static_cast<std::size_t>(n));
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  return out + (WIFSIGNALED(status) ? " killed by signal " + std::to_string(WTERMSIG(status)) : "");
}

struct Told {
  std::mutex mutex;
  std::condition_variable changed;
  std::string names;
  void add(const std::string& name) {
    const std::lock_guard lock(mutex);
    names += name + " ";
    changed.notify_all();
  }
  std::string wait_for(const std::string& name) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, std::chrono::seconds(20), [&] { return names.find(name) != std::string::npos; });
    return names;
  }
};

std::string try_all(Told& told) {
  std::string out;
  const auto refused = [&](const char* name, bool failed) { out += std::string(name) + (failed && errno == EPERM ? " refused; " : " NOT REFUSED; "); };
  char program[] = "/bin/true";
  char* arguments[] = {program, nullptr};
  refused("execve", ::execv(program, arguments) != 0);
  refused("fork", ::fork() == -1);
  refused("socket", ::socket(AF_INET, SOCK_STREAM, 0) == -1);
  refused("raw", ::socket(AF_PACKET, SOCK_RAW, 0) == -1);
  refused("code", ::mmap(nullptr, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED);
  refused("mount", ::chroot("/") != 0);
  refused("kill", ::kill(::getppid(), 0) != 0);
  return out + told.wait_for("kill");
}

std::string skip_reason() {
  static const std::string reason = [] {
    const std::string said = in_child([] {
      try {
        const SystemCallGuard guard({});
        return std::string();
      } catch (const std::exception& e) {
        return std::string(e.what());
      }
    });
    return said;
  }();
  return reason;
}

#ifdef BOOTHD_SANITIZED
#define SKIP_WITHOUT_SECCOMP() GTEST_SKIP() << "skipped: sanitizers make other system calls"
#else
#define SKIP_WITHOUT_SECCOMP() \
  if (!skip_reason().empty()) GTEST_SKIP() << "skipped: " << skip_reason()
#endif

TEST(SystemCalls, WhatBoothdNeverDoesIsRefusedAndNamed) {
  SKIP_WITHOUT_SECCOMP();
  const std::string said = in_child([] {
    Told told;
    const SystemCallGuard guard([&](const std::string& name, int, std::uint32_t) { told.add(name); });
    return try_all(told);
  });
  EXPECT_THAT(said, Not(HasSubstr("NOT REFUSED")));
  for (const char* name : {"execve", "clone", "socket", "mmap", "chroot", "kill"}) EXPECT_THAT(said, HasSubstr(std::string(name) + " "));
}

TEST(SystemCalls, ThreadsThatWereThereBeforeAreHeldToo) {
  SKIP_WITHOUT_SECCOMP();
  const std::string said = in_child([] {
    Told told;
    std::string out;
    std::mutex mutex;
    mutex.lock();
    std::thread before([&] {
      sigset_t all;  // as the DDS library's threads have it
      ::sigfillset(&all);
      ::pthread_sigmask(SIG_SETMASK, &all, nullptr);
      const std::lock_guard lock(mutex);
      out = try_all(told);
    });
    {
      const SystemCallGuard guard([&](const std::string& name, int, std::uint32_t) { told.add(name); });
      mutex.unlock();
      before.join();
    }
    return out;
  });
  EXPECT_THAT(said, HasSubstr("execve refused"));
  EXPECT_THAT(said, Not(HasSubstr("NOT REFUSED")));
}

TEST(SystemCalls, WhatItDoesGoesOn) {
  SKIP_WITHOUT_SECCOMP();
  const std::string said = in_child([] {
    Told told;
    const SystemCallGuard guard([&](const std::string& name, int, std::uint32_t) { told.add(name); });
    std::string out;
    std::thread([&] { out += "thread "; }).join();
    char name[] = "/tmp/system-calls-test.XXXXXX";
    const int fd = ::mkstemp(name);
    if (fd >= 0 && ::write(fd, "x", 1) == 1 && ::fsync(fd) == 0 && ::unlink(name) == 0) out += "file ";
    const int word = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (word >= 0) out += "socket ";
    const std::string large(64 << 20, 'x');
    return out + (large.back() == 'x' ? "memory " : "") + "told: " + told.names;
  });
  EXPECT_EQ(said, "thread file socket memory told: ");
}

TEST(SystemCalls, AfterTheGuardNothingIsWiderAndNothingHangs) {
  SKIP_WITHOUT_SECCOMP();
  const std::string said = in_child([] {
    { const SystemCallGuard guard({}); }
    return std::string(::chroot("/") != 0 && errno == ENOSYS ? "refused" : "allowed");
  });
  EXPECT_EQ(said, "refused");
}

}  // namespace
}  // namespace booth::daemon
