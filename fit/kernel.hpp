// Marks the functions whose loops are worth compiling once for each x86-64 vector width; the loader picks one at start.
#pragma once

// Loops so marked work lane by lane (no reduction across lanes) and fused multiply-add is off, so every version gives the same bits.
// Sanitizers run before the loader has resolved such functions, and other processors have no versions to choose from: plain there.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(BOOTHD_SANITIZED)
#define BOOTH_KERNEL __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define BOOTH_KERNEL
#endif
