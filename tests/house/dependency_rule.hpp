// Who may include whom, as data and as a check over sources in memory, so that a planted violation can prove the check.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace booth::tests {

/// Path from the root, with '/', to contents.
using Sources = std::map<std::string, std::string>;

/// All C and C++ sources and headers below the given folders of `root`.
Sources read_sources(const std::filesystem::path& root, const std::vector<std::string>& folders);

struct Include {
  std::string name;
  bool quoted = false;
  int line = 0;
};

/// #include lines outside comments.
std::vector<Include> includes_of(const std::string& contents);

/// One sentence a violation, beginning with "path:line:". Rules: docs/design/house.md.
std::vector<std::string> dependency_violations(const Sources& sources);

/// One sentence for each cycle of quoted includes.
std::vector<std::string> include_cycles(const Sources& sources);

}  // namespace booth::tests
