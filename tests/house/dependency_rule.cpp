// The table of rooms and libraries, and the walk over every #include.
#include "tests/house/dependency_rule.hpp"

#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>
#include <set>
#include <string_view>

namespace booth::tests {
namespace {

bool starts_with(std::string_view text, std::string_view prefix) { return text.substr(0, prefix.size()) == prefix; }

/// Which library a header in angle brackets belongs to; "" when nobody has said.
std::string library_of(const std::string& header) {
  struct Prefix {
    const char* header;
    const char* library;
  };
  static constexpr Prefix prefixes[] = {{"Eigen/", "Eigen"},
                                        {"flann/", "FLANN"},
                                        {"libusb-1.0/", "libusb"},
                                        {"gpiod.h", "libgpiod"},
                                        {"png.h", "libpng"},
                                        {"sqlite3.h", "SQLite"},
                                        {"fastcdr/", "Fast-CDR"},
                                        {"zstd.h", "zstd"},
                                        {"toml++/", "toml++"},
                                        {"CLI/", "CLI11"},
                                        {"fmt/", "fmt"},
                                        {"nlohmann/", "nlohmann-json"},
                                        {"systemd/", "libsystemd"},
                                        {"dds/", "Cyclone DDS"},
                                        {"zlib.h", "zlib"},
                                        {"opencv2/", "OpenCV"},
                                        {"assimp/", "assimp"},
                                        {"gtest/", "GoogleTest"},
                                        {"gmock/", "GoogleTest"},
                                        {"rapidcheck", "RapidCheck"},
                                        {"benchmark/", "Google Benchmark"},
                                        {"seccomp.h", "libseccomp"},
                                        {"openssl/", "OpenSSL"},
                                        {"sodium.h", "libsodium"},
                                        {"cuda_runtime.h", "CUDA"}};
  for (const Prefix& p : prefixes)
    if (starts_with(header, p.header)) return p.library;
  static const std::set<std::string> compiler{"immintrin.h", "arm_neon.h"};
  if (compiler.contains(header)) return "compiler";
  // The standard library's headers have no ending; what else ends in .h without a known prefix is the C library's or the kernel's.
  if (header.find('.') == std::string::npos && header.find('/') == std::string::npos) return "std";
  static const std::set<std::string> c_of_cpp{"math.h", "float.h"};  // what a device's compiler takes, too
  if (c_of_cpp.contains(header)) return "std";
  static const std::set<std::string> posix{"cpuid.h", "unistd.h", "fcntl.h", "poll.h",  "time.h",  "signal.h",  "stdlib.h",  "pthread.h", "dirent.h",
                                           "grp.h",   "pwd.h",    "errno.h", "sched.h", "netdb.h", "ifaddrs.h", "termios.h", "spawn.h"};
  if (posix.contains(header) || starts_with(header, "sys/") || starts_with(header, "linux/") || starts_with(header, "net/") ||
      starts_with(header, "netinet/") || starts_with(header, "arpa/"))
    return "POSIX";
  return "";
}

struct Rule {
  const char* folder;           ///< prefix of the path; the longest that fits decides
  std::set<std::string> rooms;  ///< quoted includes may lie in these; a room, or a folder of one
  std::set<std::string> libraries;
};

const std::vector<Rule>& rules() {
  static const std::vector<Rule> all{
      {"hal/", {"hal"}, {"std"}},
      {"fit/", {"fit"}, {"std", "compiler", "Eigen", "FLANN"}},
      // What runs kernels knows nothing of the estimator, so that a driver may put kernels on a device, too.
      {"fit/gpu/", {"fit/gpu"}, {"std", "CUDA"}},
      {"drivers/kinect2/", {"hal", "drivers", "fit/gpu"}, {"std", "POSIX", "compiler", "libusb"}},
      {"drivers/", {"hal", "drivers"}, {"std", "POSIX", "compiler", "libusb", "libgpiod"}},
      {"drivers/synthetic/", {"hal", "drivers", "fit"}, {"std", "POSIX", "compiler", "Eigen"}},
      {"drivers/kinect2/emulator/", {"hal", "drivers", "fit"}, {"std", "POSIX", "compiler", "Eigen"}},
      {"drivers/recording/", {"hal", "drivers"}, {"std", "POSIX", "libpng", "SQLite", "Fast-CDR", "zstd", "toml++"}},
      {"daemon/",
       {"hal", "fit", "daemon"},
       {"std", "POSIX", "Eigen", "Cyclone DDS", "libsystemd", "libseccomp", "toml++", "CLI11", "fmt", "nlohmann-json", "libpng", "zlib"}},
      // The one place where drivers are constructed.
      {"daemon/drivers_factory.", {"hal", "fit", "daemon", "drivers"}, {"std", "POSIX", "fmt", "Eigen"}},
      // Cryptography in one place.
      {"daemon/seal/", {"hal", "daemon"}, {"std", "POSIX", "fmt", "libsodium"}},
      // assimp writes FBX; OpenCV calibrates: each in its own corner.
      {"daemon/record/export", {"hal", "fit", "daemon"}, {"std", "Eigen", "fmt", "assimp"}},
      // Certificates and signatures stay in one folder.
      {"daemon/security/", {"daemon"}, {"std", "POSIX", "fmt", "OpenSSL"}},
      {"daemon/calibrate/", {"hal", "fit", "daemon"}, {"std", "POSIX", "Eigen", "fmt", "toml++", "OpenCV"}},
  };
  return all;
}

const Rule* rule_for(const std::string& path) {
  const Rule* best = nullptr;
  for (const Rule& r : rules())
    if (starts_with(path, r.folder) && (best == nullptr || std::string_view(r.folder).size() > std::string_view(best->folder).size())) best = &r;
  return best;
}

std::string listed(const std::set<std::string>& names) {
  std::string out;
  for (const std::string& n : names) out += (out.empty() ? "" : ", ") + n;
  return out;
}

/// Written by idlc into the build folder; not rooted.
bool generated(const std::string& path, const std::string& header) {
  return starts_with(path, "daemon/dds/") && (header == "booth.h" || header == "ros2_messages.h");
}

}  // namespace

Sources read_sources(const std::filesystem::path& root, const std::vector<std::string>& folders) {
  static const std::set<std::string> endings{".hpp", ".cpp", ".h", ".c", ".hh", ".cc", ".cu", ".cuh", ".inl", ".ipp"};
  Sources out;
  for (const std::string& folder : folders)
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      if (!entry.is_regular_file() || !endings.contains(entry.path().extension().string())) continue;
      std::ifstream in(entry.path(), std::ios::binary);
      out[entry.path().lexically_relative(root).generic_string()] = {std::istreambuf_iterator<char>(in), {}};
    }
  return out;
}

std::vector<Include> includes_of(const std::string& contents) {
  std::vector<Include> out;
  bool in_comment = false;
  int number = 0;
  for (std::size_t at = 0; at < contents.size();) {
    const std::size_t end = std::min(contents.find('\n', at), contents.size());
    std::string line = contents.substr(at, end - at);
    at = end + 1;
    ++number;
    // Block comments that begin or end in this line; a directive stands on a line of its own, so this needs no more care than that.
    if (in_comment) {
      const std::size_t close = line.find("*/");
      if (close == std::string::npos) continue;
      line.erase(0, close + 2);
      in_comment = false;
    }
    for (std::size_t open = line.find("/*"); open != std::string::npos; open = line.find("/*")) {
      const std::size_t close = line.find("*/", open);
      in_comment = close == std::string::npos;
      line.erase(open, in_comment ? std::string::npos : close + 2 - open);
    }
    const auto skip = [&](std::size_t i) { return line.find_first_not_of(" \t", i); };
    std::size_t i = skip(0);
    if (i == std::string::npos || line[i] != '#') continue;
    i = skip(i + 1);
    if (i == std::string::npos || line.compare(i, 7, "include") != 0) continue;
    i = skip(i + 7);
    if (i == std::string::npos || (line[i] != '"' && line[i] != '<')) continue;
    const std::size_t close = line.find(line[i] == '"' ? '"' : '>', i + 1);
    if (close != std::string::npos) out.push_back({line.substr(i + 1, close - i - 1), line[i] == '"', number});
  }
  return out;
}

std::vector<std::string> dependency_violations(const Sources& sources) {
  std::vector<std::string> out;
  for (const auto& [path, contents] : sources) {
    const Rule* rule = rule_for(path);
    if (rule == nullptr) {
      out.push_back(path + ":1: this folder has no rule");
      continue;
    }
    for (const Include& include : includes_of(contents)) {
      const std::string where = path + ":" + std::to_string(include.line) + ": ";
      if (include.quoted) {
        if (generated(path, include.name)) continue;
        const std::string room = include.name.substr(0, include.name.find('/'));
        if (!sources.contains(include.name))
          out.push_back(where + "\"" + include.name + "\" is not a file of the rooms, named from the root");
        else if (std::none_of(rule->rooms.begin(), rule->rooms.end(), [&](const std::string& r) { return starts_with(include.name, r + "/"); }))
          out.push_back(where + rule->folder + " may not include " + room + " (\"" + include.name + "\"); it may include " + listed(rule->rooms));
        continue;
      }
      const std::string library = library_of(include.name);
      if (library.empty())
        out.push_back(where + "nobody has said which library <" + include.name + "> belongs to; say so in tests/house/dependency_rule.cpp");
      else if (!rule->libraries.contains(library))
        out.push_back(where + rule->folder + " may not include " + library + " (<" + include.name + ">); it may include " + listed(rule->libraries));
    }
  }
  return out;
}

std::vector<std::string> include_cycles(const Sources& sources) {
  enum class Mark { fresh, open, done };
  std::map<std::string, Mark> marks;
  std::vector<std::string> chain, out;
  const std::function<void(const std::string&)> visit = [&](const std::string& path) {
    marks[path] = Mark::open;
    chain.push_back(path);
    for (const Include& include : includes_of(sources.at(path))) {
      if (!include.quoted || !sources.contains(include.name)) continue;
      const Mark mark = marks[include.name];
      if (mark == Mark::fresh) {
        visit(include.name);
      } else if (mark == Mark::open) {
        std::string cycle;
        for (auto it = std::find(chain.begin(), chain.end(), include.name); it != chain.end(); ++it) cycle += *it + " -> ";
        out.push_back(cycle + include.name);
      }
    }
    chain.pop_back();
    marks[path] = Mark::done;
  };
  for (const auto& [path, contents] : sources)
    if (marks[path] == Mark::fresh) visit(path);
  return out;
}

}  // namespace booth::tests
