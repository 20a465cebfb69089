// The most multiply-adds a second that one core of this machine does, measured: the arithmetic floor that a kernel is compared with.
#pragma once

#include <string_view>

namespace booth::bench {

/// Multiply-adds per second, single precision, in registers only, with the vectors of a kernel ("avx512", "avx2"; the baseline multiplies and adds
/// in two instructions). 0 for other names and where the processor has no such vectors.
double peak_multiply_adds(std::string_view kernel);

}  // namespace booth::bench
