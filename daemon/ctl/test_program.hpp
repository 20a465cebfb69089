// Verbs that measure (bench, evaluate) are programs of the test tree, which boothctl becomes where they are installed.
#pragma once

#include <string>
#include <vector>

namespace booth::daemon {

/// Replaces this process by `program` (beside boothctl in a build, in the private folder of an installation) with these arguments. Returns only by a
/// VerbFailure that begins with `verb`.
[[noreturn]] void become_test_program(const std::string& verb, const std::string& program, const std::vector<std::string>& arguments);

}  // namespace booth::daemon
