// Asks boothd's control socket what state it is in, or waits for one: starting boothctl and its libraries for each look costs the guest as much as a session.
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace {

constexpr int kUsage = 64;
constexpr timespec kPause{0, 100'000'000};  // between two looks
constexpr time_t kPatience = 10;            // for an answer

void usage() {
  std::fprintf(stderr,
               "usage: booth_status SOCKET [--until NAME=VALUE SECONDS] [NAME...]\n"
               "  NAME: a word of boothd's status, or `running`, the number of cameras that run; what they are is printed on one line, from one answer.\n"
               "  --until: looks until the status says so. Status 1: it did not, or boothd does not answer.\n");
}

double now() {
  timespec at{};
  ::clock_gettime(CLOCK_MONOTONIC, &at);
  return static_cast<double>(at.tv_sec) + static_cast<double>(at.tv_nsec) * 1e-9;
}

/// The line that answers, or nothing.
std::string ask(const char* path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return {};
  const timeval limit{kPatience, 0};
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  constexpr std::string_view request = "{\"request\":\"status\"}\n";
  std::string out;
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
      ::send(fd, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size())) {
    char text[16384];
    for (ssize_t n = 0; out.find('\n') == std::string::npos && (n = ::recv(fd, text, sizeof text, 0)) > 0;) out.append(text, static_cast<std::size_t>(n));
  }
  ::close(fd);
  return out.find('\n') == std::string::npos ? std::string() : out;
}

/// As a shell wants it: strings without quotes; "?" for what the answer does not have.
std::string word(const nlohmann::json& status, const std::string& name) {
  if (name == "running" && status.contains("cameras")) {
    int n = 0;
    for (const auto& camera : status["cameras"]) n += camera.value("state", "") == "running";
    return std::to_string(n);
  }
  if (!status.contains(name)) return "?";
  return status[name].is_string() ? status[name].get<std::string>() : status[name].dump();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return usage(), kUsage;
  int first = 2;
  std::string name, value;
  double seconds = 0;
  if (std::strcmp(argv[2], "--until") == 0) {
    const char* equals = argc < 5 ? nullptr : std::strchr(argv[3], '=');
    char* end = nullptr;
    if (equals != nullptr) seconds = std::strtod(argv[4], &end);
    if (equals == nullptr || end == argv[4] || *end != 0) return usage(), kUsage;
    name.assign(argv[3], static_cast<std::size_t>(equals - argv[3])), value = equals + 1;
    first = 5;
  }
  const double limit = now() + seconds;
  std::string said;
  while (true) {
    said = ask(argv[1]);
    const auto status = nlohmann::json::parse(said, nullptr, false);
    if (status.is_object() && (name.empty() || word(status, name) == value)) {
      for (int i = first; i < argc; ++i) std::printf("%s%s", word(status, argv[i]).c_str(), i + 1 < argc ? " " : "\n");
      return 0;
    }
    if (name.empty() || now() >= limit) break;
    ::nanosleep(&kPause, nullptr);
  }
  if (said.empty()) std::fprintf(stderr, "booth_status: nobody answers at %s; is boothd running?\n", argv[1]);
  if (!said.empty())
    std::fprintf(stderr, "booth_status: %s is not what was waited for; boothd says %s", name.empty() ? "the answer" : name.c_str(), said.c_str());
  return 1;
}
