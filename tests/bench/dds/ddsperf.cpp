// Runs two ddsperf and reads what the pinging one prints.
#include "tests/bench/dds/ddsperf.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace booth::bench {
namespace {

double after(const char* line, const char* label) {
  const char* at = std::strstr(line, label);
  return at ? std::strtod(at + std::strlen(label), nullptr) : -1;
}

}  // namespace

std::vector<PingFigures> ddsperf_ping(const std::string& uri, int domain, int bytes, int hertz, int seconds, const std::string& trigger) {
  if (::access("/usr/bin/ddsperf", X_OK) != 0)
    throw std::runtime_error("ddsperf is not installed (Debian package cyclonedds-tools); without it there is no reference");
  ::setenv("CYCLONEDDS_URI", uri.c_str(), 1);
  const std::string id = std::to_string(domain), limit = std::to_string(seconds + 3);
  const pid_t pong = ::fork();
  if (pong == 0) {
    if (!std::freopen("/dev/null", "w", stdout)) ::_exit(127);
    ::execl("/usr/bin/ddsperf", "ddsperf", "-u", "-i", id.c_str(), "-D", limit.c_str(), "pong", trigger.c_str(), nullptr);
    ::_exit(127);
  }
  const std::string command = fmt::format("/usr/bin/ddsperf -u -i {} -D{} ping {}Hz size {} {} 2>&1", domain, seconds, hertz, bytes, trigger);
  FILE* pipe = ::popen(command.c_str(), "r");
  std::vector<PingFigures> out;
  char line[1024];
  while (pipe && std::fgets(line, sizeof line, pipe)) {
    if (!std::strstr(line, " size ") || !std::strstr(line, "50% ")) continue;
    out.push_back({.p50_us = after(line, "50% "), .p99_us = after(line, "99% "), .count = static_cast<int>(after(line, "cnt "))});
  }
  if (pipe) ::pclose(pipe);
  ::kill(pong, SIGTERM);
  ::waitpid(pong, nullptr, 0);
  ::unsetenv("CYCLONEDDS_URI");
  if (out.size() < 2) throw std::runtime_error("ddsperf printed no round trips; is the loopback interface up?");
  out.erase(out.begin());
  return out;
}

}  // namespace booth::bench
