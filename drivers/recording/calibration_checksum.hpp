// A line in calibration.toml that says what its other bytes sum up to: a digit that became another digit is another calibration, and nothing else would notice.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace booth::drivers {

/// CRC-64 of ECMA-182 as xz has it (reflected, all ones before and after): what differs in one byte, or within eight neighbouring ones, never has the same.
std::uint64_t crc64(std::string_view bytes);

/// The text with `checksum = "crc64:..."` behind its line `version = N`, or at its top where it has none; a line that was there is replaced. What stood in the
/// text otherwise stays as it is, byte for byte.
std::string with_checksum(std::string_view text);

enum class ChecksumVerdict : std::uint8_t {
  right,
  wrong,   ///< another sum
  broken,  ///< there is no line as with_checksum() writes it
};
/// Of a text that has the key `checksum` before its first table.
ChecksumVerdict check_checksum(std::string_view text);

}  // namespace booth::drivers
