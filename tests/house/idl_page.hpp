// The part of docs/reference/dds.md that is made from the IDL.
#pragma once

#include <string>

namespace booth::tests {

/// Markdown: constants, enumerations, and one table of members for each struct of `idl` (the text of booth.idl, one member a line, comments behind it).
std::string types_of_idl(const std::string& idl);

}  // namespace booth::tests
