// Marks the functions that a graphics processor's compiler compiles a second time for the device, so that both sides share one source.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__CUDACC__)
#define BOOTH_HOST_DEVICE __host__ __device__ __forceinline__
#elif defined(__GNUC__)
#define BOOTH_HOST_DEVICE inline __attribute__((always_inline))
#else
#define BOOTH_HOST_DEVICE inline
#endif

// The same for long functions, where the host's compiler is to choose what it puts into its callers.
#if defined(__CUDACC__)
#define BOOTH_HOST_DEVICE_LONG __host__ __device__ __forceinline__
#else
#define BOOTH_HOST_DEVICE_LONG inline
#endif

namespace booth::gpu {

/// The bits of a float, and back: std::bit_cast, which not every device's compiler takes.
BOOTH_HOST_DEVICE std::int32_t bits_of(float x) {
  std::int32_t i;
  memcpy(&i, &x, sizeof i);
  return i;
}
BOOTH_HOST_DEVICE float float_of(std::int32_t i) {
  float x;
  memcpy(&x, &i, sizeof x);
  return x;
}

}  // namespace booth::gpu
