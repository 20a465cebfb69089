// Replaces the global operator new; sanitizers keep theirs, and then nothing is counted.
#include "tests/conformance/operator_new_count.hpp"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {
std::atomic<std::uint64_t> calls{0};
}

namespace booth::tests {
std::uint64_t operator_new_count() { return calls; }
}  // namespace booth::tests

#ifndef BOOTHD_SANITIZED
void* operator new(std::size_t size) {
  ++calls;
  if (void* p = std::malloc(size > 0 ? size : 1)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
#endif
