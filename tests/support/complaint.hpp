// What a call complains of: tests of bad input ask for the sentence, not only for an exception.
#pragma once

#include <exception>
#include <string>

namespace booth::tests {

/// The text of what `call()` throws; empty when it throws nothing.
template <class F>
std::string complaint(F call) {
  try {
    call();
  } catch (const std::exception& e) {
    return e.what();
  }
  return {};
}

}  // namespace booth::tests
