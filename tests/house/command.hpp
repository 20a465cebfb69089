// Runs a shell command in the source tree and keeps what it says.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace booth::tests {

struct CommandResult {
  int status = -1;
  std::string output;  ///< stdout and stderr
};

inline CommandResult run_in_source_tree(const std::string& command) {
  CommandResult out;
  std::FILE* pipe = ::popen(("cd '" BOOTH_SOURCE_DIR "' && { " + command + "; } 2>&1").c_str(), "r");
  if (pipe == nullptr) return out;
  std::array<char, 4096> part;
  for (std::size_t n; (n = std::fread(part.data(), 1, part.size(), pipe)) > 0;) out.output.append(part.data(), n);
  const int status = ::pclose(pipe);
  out.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return out;
}

inline bool has_program(const std::string& name) { return run_in_source_tree("command -v " + name).status == 0; }

}  // namespace booth::tests
