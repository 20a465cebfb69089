// Reading little-endian numbers out of untrusted, unaligned bytes.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace booth::drivers::kinect2 {

/// The caller has checked that `at` and the number's bytes are there.
inline std::uint16_t read_u16(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at]) | std::to_integer<unsigned>(bytes[at + 1]) << 8);
}
inline std::uint32_t read_u32(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint32_t>(read_u16(bytes, at)) | static_cast<std::uint32_t>(read_u16(bytes, at + 2)) << 16;
}
inline std::uint64_t read_u64(std::span<const std::byte> bytes, std::size_t at) {
  return static_cast<std::uint64_t>(read_u32(bytes, at)) | static_cast<std::uint64_t>(read_u32(bytes, at + 4)) << 32;
}
inline float read_f32(std::span<const std::byte> bytes, std::size_t at) { return std::bit_cast<float>(read_u32(bytes, at)); }

inline void write_u16(std::span<std::byte> bytes, std::size_t at, std::uint16_t value) {
  bytes[at] = static_cast<std::byte>(value & 0xFF);
  bytes[at + 1] = static_cast<std::byte>(value >> 8);
}
inline void write_u32(std::span<std::byte> bytes, std::size_t at, std::uint32_t value) {
  write_u16(bytes, at, static_cast<std::uint16_t>(value & 0xFFFF));
  write_u16(bytes, at + 2, static_cast<std::uint16_t>(value >> 16));
}
inline void write_u64(std::span<std::byte> bytes, std::size_t at, std::uint64_t value) {
  write_u32(bytes, at, static_cast<std::uint32_t>(value & 0xFFFF'FFFF));
  write_u32(bytes, at + 4, static_cast<std::uint32_t>(value >> 32));
}
inline void write_f32(std::span<std::byte> bytes, std::size_t at, float value) { write_u32(bytes, at, std::bit_cast<std::uint32_t>(value)); }

}  // namespace booth::drivers::kinect2
