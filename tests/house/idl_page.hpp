// The parts of docs/reference/dds.md and ros2.md that are made from IDL.
#pragma once

#include <string>

namespace booth::tests {

/// Markdown: constants, enumerations, and one table of members for each struct of `idl` (plain IDL as ours: one member a line, comments behind it); of the
/// first two, those that there are. Types in modules pkg::msg::dds_ under the names that ROS 2 gives them.
std::string types_of_idl(const std::string& idl);

}  // namespace booth::tests
