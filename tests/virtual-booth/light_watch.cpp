// Looks at one GPIO line of the kernel's simulator many times a second and writes down when it changed, until SIGTERM.
#include <fcntl.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>

namespace {

volatile sig_atomic_t ended = 0;

/// '0', '1', or 0 where the line cannot be read.
char level(const char* file) {
  const int fd = ::open(file, O_RDONLY | O_CLOEXEC);
  char c = 0;
  if (fd < 0 || ::read(fd, &c, 1) != 1) c = 0;
  if (fd >= 0) ::close(fd);
  return c;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: light_watch VALUE_FILE\n");
    return 64;
  }
  ::signal(SIGTERM, [](int) { ended = 1; });
  for (char before = 0; !ended;) {
    const char now = level(argv[1]);
    if (now == 0) {
      std::fprintf(stderr, "light_watch: %s cannot be read\n", argv[1]);
      return 1;
    }
    if (now != before) {
      timespec at{};
      ::clock_gettime(CLOCK_BOOTTIME, &at);
      std::printf("%lld.%06ld %c\n", static_cast<long long>(at.tv_sec), at.tv_nsec / 1000, now);
      std::fflush(stdout);
      before = now;
    }
    const timespec pause{0, 5'000'000};
    ::nanosleep(&pause, nullptr);
  }
  return 0;
}
