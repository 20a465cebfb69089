// Marks the functions that a graphics processor's compiler compiles a second time for the device, so that both sides share one source.
#pragma once

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
