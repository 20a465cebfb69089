// Looks where a build and an installation put them.
#include "daemon/ctl/test_program.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {

void become_test_program(const std::string& verb, const std::string& program, const std::vector<std::string>& arguments) {
  std::error_code error;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  for (const auto& candidate : {folder / program, folder.parent_path() / "lib/boothd" / program}) {
    if (error || ::access(candidate.c_str(), X_OK) != 0) continue;
    std::vector<std::string> words{candidate.string()};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    ::execv(candidate.c_str(), pointers.data());
    throw VerbFailure(fmt::format("{}: {} cannot be started: {}", verb, candidate.string(), std::strerror(errno)));
  }
  throw VerbFailure(fmt::format("{}: {} is not installed beside boothctl; it comes with a build of the source tree (toolchain/test)", verb, program));
}

}  // namespace booth::daemon
