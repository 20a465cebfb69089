// libseccomp makes the filter; it is loaded by hand, because all that is not listed goes to the process's own listener.
#include "daemon/health/system_calls.hpp"

#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <seccomp.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace booth::daemon {
namespace {

// Measured: all calls after READY of sessions on emulated sensors, with recording, snapshot, DDS and a simulated panel (docs/design/hardening.md says how); of
// calls that do the same in another kernel or library both are here. Names that an architecture does not have are passed over.
constexpr const char* kAllowed[] = {
    // memory and threads
    "brk", "munmap", "mremap", "madvise", "mlock", "munlock", "futex", "set_robust_list", "rseq", "exit", "exit_group", "sched_yield", "membarrier", "getcpu",
    "sched_getaffinity", "sched_setscheduler", "sched_getscheduler", "sched_getparam", "sched_get_priority_max", "sched_get_priority_min", "gettid", "getpid",
    "tgkill", "rt_sigaction", "rt_sigprocmask", "rt_sigreturn", "rt_sigtimedwait", "sigaltstack", "restart_syscall",
    // time and waiting
    "clock_gettime", "clock_getres", "clock_nanosleep", "nanosleep", "gettimeofday", "time", "poll", "ppoll", "select", "pselect6", "epoll_create1",
    "epoll_ctl", "epoll_wait", "epoll_pwait", "eventfd2", "pipe2", "timerfd_create", "timerfd_settime",
    // files of sessions and recordings, configuration of sensors, /sys
    "open", "openat", "close", "read", "write", "readv", "writev", "pread64", "pwrite64", "lseek", "fstat", "stat", "lstat", "newfstatat", "statx", "access",
    "faccessat", "faccessat2", "getdents64", "readlink", "readlinkat", "getcwd", "mkdir", "mkdirat", "rmdir", "unlink", "unlinkat", "rename", "renameat",
    "renameat2", "ftruncate", "fallocate", "fsync", "fdatasync", "syncfs", "statfs", "fstatfs", "chmod", "fchmod", "fchmodat", "fchown", "flock", "fcntl",
    "utimensat", "umask", "dup", "dup3", "fadvise64", "copy_file_range", "sendfile",
    // sockets that there are, those of the control socket, and a word to systemd
    "connect", "accept", "accept4", "shutdown", "getsockname", "getpeername", "getsockopt", "setsockopt", "sendto", "sendmsg", "sendmmsg", "recvfrom",
    "recvmsg", "recvmmsg",
    // about itself
    "getuid", "geteuid", "getgid", "getegid", "getrandom", "getrusage", "getrlimit", "prlimit64", "sysinfo", "uname"};

// ioctl() by its kind (asm-generic/ioctl.h: bits 8 to 15): usbfs 'U', GPIO 0xB4, interfaces of the network 0x89, this guard's own '!'; three of terminals, and
// whether what was sent has been taken.
constexpr std::uint64_t kIoctlKinds[] = {0x55, 0xB4, 0x89, 0x21};
constexpr std::uint64_t kIoctls[] = {0x5401 /* TCGETS */, 0x541B /* FIONREAD */, 0x5421 /* FIONBIO */, 0x5411 /* SIOCOUTQ */};

[[noreturn]] void fail(const std::string& what, int error) {
  throw std::runtime_error("the list of system calls cannot be made narrower: " + what + ": " + std::generic_category().message(error));
}

struct Filter {
  scmp_filter_ctx context = ::seccomp_init(SCMP_ACT_NOTIFY);
  Filter() {
    if (context == nullptr) fail("seccomp_init", ENOSYS);
  }
  ~Filter() { ::seccomp_release(context); }
  Filter(const Filter&) = delete;

  void allow(const char* name, const std::vector<scmp_arg_cmp>& conditions = {}, std::uint32_t action = SCMP_ACT_ALLOW) const {
    const int number = ::seccomp_syscall_resolve_name(name);
    if (number < 0) return;
    if (const int error = ::seccomp_rule_add_array(context, action, number, static_cast<unsigned>(conditions.size()), conditions.data()); error != 0)
      fail(name, -error);
  }
};

scmp_arg_cmp masked(unsigned argument, std::uint64_t mask, std::uint64_t value) { return {argument, SCMP_CMP_MASKED_EQ, mask, value}; }
scmp_arg_cmp equal(unsigned argument, std::uint64_t value) { return {argument, SCMP_CMP_EQ, value, 0}; }

void fill(const Filter& filter) {
  for (const char* name : kAllowed) filter.allow(name);
  // No new code.
  filter.allow("mmap", {masked(2, PROT_EXEC, 0)});
  filter.allow("mprotect", {masked(2, PROT_EXEC, 0)});
  // Threads, not processes. Of clone3 the filter could not see the flags: without it the C library takes clone.
  filter.allow("clone", {masked(0, CLONE_THREAD | CLONE_VM, CLONE_THREAD | CLONE_VM)});
  filter.allow("clone3", {}, SCMP_ACT_ERRNO(ENOSYS));
  filter.allow("socket", {equal(0, AF_UNIX)});
  filter.allow("prctl", {equal(0, PR_SET_NAME)});
  filter.allow("prctl", {equal(0, PR_GET_NAME)});
  for (const auto kind : kIoctlKinds) filter.allow("ioctl", {masked(1, 0xFF00, kind << 8)});
  for (const auto request : kIoctls) filter.allow("ioctl", {equal(1, request)});
}

/// The filter as the kernel takes it.
std::vector<sock_filter> compile() {
  Filter filter;
  fill(filter);
  // A tree of comparisons instead of a list: a call costs some tens of nanoseconds.
  (void)::seccomp_attr_set(filter.context, SCMP_FLTATR_CTL_OPTIMIZE, 2);
  const int fd = ::memfd_create("filter", MFD_CLOEXEC);
  if (fd < 0) fail("memfd_create", errno);
  std::vector<sock_filter> out;
  const int error = ::seccomp_export_bpf(filter.context, fd);
  if (error == 0) {
    out.resize(static_cast<std::size_t>(::lseek(fd, 0, SEEK_END)) / sizeof(sock_filter));
    const auto bytes = static_cast<ssize_t>(out.size() * sizeof(sock_filter));
    if (::pread(fd, out.data(), static_cast<std::size_t>(bytes), 0) != bytes) out.clear();
  }
  ::close(fd);
  if (error != 0 || out.empty() || out.size() > BPF_MAXINSNS) fail("seccomp_export_bpf", error != 0 ? -error : EIO);
  return out;
}

/// Returns the listener.
int load(std::vector<sock_filter>& instructions) {
  const sock_fprog program{static_cast<unsigned short>(instructions.size()), instructions.data()};
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) fail("PR_SET_NO_NEW_PRIVS", errno);
  const unsigned flags = SECCOMP_FILTER_FLAG_TSYNC | SECCOMP_FILTER_FLAG_TSYNC_ESRCH | SECCOMP_FILTER_FLAG_NEW_LISTENER;
  const long fd = ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, flags, &program);
  if (fd < 0) fail("seccomp", errno);
  return static_cast<int>(fd);
}

std::string name_of(int number) {
  char* name = ::seccomp_syscall_resolve_num_arch(SCMP_ARCH_NATIVE, number);
  std::string out = name != nullptr ? name : "unknown";
  ::free(name);
  return out;
}

}  // namespace

/// Two threads: one answers and takes no lock, because whoever waits for its answer may hold any (fork() holds the allocator's); the other tells.
class SystemCallGuard::Watch {
 public:
  explicit Watch(Refused refused) : refused_(std::move(refused)) {
    try {
      if (::pipe2(told_, O_CLOEXEC | O_NONBLOCK) != 0 || (end_ = ::eventfd(0, EFD_CLOEXEC)) < 0) fail("no descriptors", errno);
      if (const int error = ::seccomp_notify_alloc(&request_, &response_); error != 0) fail("seccomp_notify_alloc", -error);
      auto instructions = compile();
      listener_ = load(instructions);
    } catch (...) {
      release();
      throw;
    }
    answering_ = std::thread([this] { answer_all(); });
    telling_ = std::thread([this] { tell_all(); });
  }
  ~Watch() {
    const std::uint64_t one = 1;
    (void)!::write(end_, &one, sizeof one);
    answering_.join();
    ::close(std::exchange(told_[1], -1));  // what is still in the pipe is told
    telling_.join();
    release();
  }
  Watch(const Watch&) = delete;

 private:
  struct Refusal {
    int number = 0;
    std::uint32_t thread = 0;
  };

  void release() const {
    ::seccomp_notify_free(request_, response_);
    for (const int fd : {listener_, end_, told_[0], told_[1]})
      if (fd >= 0) ::close(fd);
  }

  void answer_all() {
    (void)::pthread_setname_np(::pthread_self(), "system calls");
    while (true) {
      pollfd wait[2]{{listener_, POLLIN, 0}, {end_, POLLIN, 0}};
      if (::poll(wait, 2, -1) < 0 && errno != EINTR) return;
      if (wait[1].revents != 0) return;
      if ((wait[0].revents & POLLIN) != 0) answer();
    }
  }

  void answer() {
    *request_ = {};                                                  // the kernel wants zeros there
    if (::seccomp_notify_receive(listener_, request_) != 0) return;  // who asked is gone
    *response_ = {};
    response_->id = request_->id;
    response_->error = -EPERM;
    const Refusal refusal{request_->data.nr, request_->pid};
    (void)::seccomp_notify_respond(listener_, response_);
    (void)!::write(told_[1], &refusal, sizeof refusal);  // a full pipe has enough to tell
  }

  void tell_all() {
    (void)::pthread_setname_np(::pthread_self(), "refusals");
    while (true) {
      pollfd wait{told_[0], POLLIN, 0};
      if (::poll(&wait, 1, -1) < 0) continue;
      Refusal refusal;
      const ssize_t n = ::read(told_[0], &refusal, sizeof refusal);
      if (n == 0) return;
      if (n == sizeof refusal && refused_) refused_(name_of(refusal.number), refusal.number, refusal.thread);
    }
  }

  const Refused refused_;
  int told_[2]{-1, -1}, end_ = -1, listener_ = -1;
  seccomp_notif* request_ = nullptr;
  seccomp_notif_resp* response_ = nullptr;
  std::thread answering_, telling_;
};

SystemCallGuard::SystemCallGuard(Refused refused) : watch_(std::make_unique<Watch>(std::move(refused))) {}
SystemCallGuard::~SystemCallGuard() = default;

}  // namespace booth::daemon
