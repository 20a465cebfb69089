// The line is found as text, not as TOML, so that what is summed up is the same for the writer and for every reader.
#include "drivers/recording/calibration_checksum.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>

namespace booth::drivers {
namespace {

constexpr std::string_view kKey = "checksum = \"crc64:";
constexpr std::string_view kRest = "\"  # of all other bytes; who edits this file takes the line out";

constexpr std::array<std::uint64_t, 256> make_table() {
  constexpr std::uint64_t kPolynomial = 0xC96C5795D7870F42u;  // ECMA-182, bits reversed
  std::array<std::uint64_t, 256> out{};
  for (std::uint64_t byte = 0; byte < 256; ++byte) {
    std::uint64_t sum = byte;
    for (int bit = 0; bit < 8; ++bit) sum = sum >> 1 ^ ((sum & 1) != 0 ? kPolynomial : 0);
    out[byte] = sum;
  }
  return out;
}

/// A line and where it ends, its newline included.
struct Line {
  std::size_t begin, end;
  std::string_view text;
};

/// The first line before the tables that begins so.
std::optional<Line> find_line(std::string_view text, std::string_view beginning) {
  for (std::size_t at = 0; at < text.size() && text[at] != '[';) {
    const std::size_t newline = std::min(text.find('\n', at), text.size());
    const std::string_view line = text.substr(at, newline - at);
    if (line.starts_with(beginning)) return Line{at, std::min(newline + 1, text.size()), line};
    at = newline + 1;
  }
  return std::nullopt;
}

std::string without(std::string_view text, const Line& line) { return std::string(text.substr(0, line.begin)).append(text.substr(line.end)); }

std::string checksum_line(std::string_view rest) {
  char sum[17];
  std::snprintf(sum, sizeof sum, "%016llx", static_cast<unsigned long long>(crc64(rest)));
  return std::string(kKey).append(sum).append(kRest);
}

}  // namespace

std::uint64_t crc64(std::string_view bytes) {
  static constexpr std::array<std::uint64_t, 256> kTable = make_table();
  std::uint64_t sum = ~std::uint64_t{0};
  for (const char c : bytes) sum = kTable[(sum ^ static_cast<unsigned char>(c)) & 0xFF] ^ sum >> 8;
  return ~sum;
}

std::string with_checksum(std::string_view text) {
  const auto old = find_line(text, "checksum = ");
  std::string out = old ? without(text, *old) : std::string(text);
  const std::string line = checksum_line(out) + "\n";
  const auto version = find_line(out, "version = ");
  return out.insert(version && out[version->end - 1] == '\n' ? version->end : 0, line);
}

ChecksumVerdict check_checksum(std::string_view text) {
  const auto line = find_line(text, kKey);
  if (!line || line->text.size() != kKey.size() + 16 + kRest.size() || !line->text.ends_with(kRest)) return ChecksumVerdict::broken;
  return line->text == checksum_line(without(text, *line)) ? ChecksumVerdict::right : ChecksumVerdict::wrong;
}

}  // namespace booth::drivers
