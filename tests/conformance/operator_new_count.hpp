// Counts calls of operator new: what boothd's own code allocates, without what libpng and SQLite take for themselves.
#pragma once

#include <cstdint>

namespace booth::tests {

/// Calls of operator new of the whole process so far; link operator_new_count.cpp.
std::uint64_t operator_new_count();

}  // namespace booth::tests
