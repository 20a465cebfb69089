// A node is: offset of its end, number of properties, bytes of properties, length of name, name, properties, children, and where there are children a record of
// zeros.
#include "daemon/record/export/fbx_repair.hpp"

#include <cstdint>
#include <cstring>

namespace booth::daemon {
namespace {

constexpr std::string_view kMagic{"Kaydara FBX Binary  \0\x1a\0", 23};
constexpr std::size_t kHeader = 27, kRecord = 25;  // 64-bit offsets: from version 7500 on
constexpr std::uint32_t kFirst64 = 7500;
constexpr int kDeepest = 64;

std::uint64_t word(std::string_view bytes, std::size_t at) {
  std::uint64_t value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

bool all_zero(std::string_view bytes) { return bytes.find_first_not_of('\0') == std::string_view::npos; }

struct Times {
  std::int64_t divisor, stop;
};

/// `properties` are a node's, in place. An array is: type, number of values, encoding (0: plain), bytes, values.
void mend_times(std::string_view id, char* properties, std::size_t size, Times times) {
  constexpr std::size_t kArrayHead = 13, kValue = 8;
  const std::string_view text(properties, size);
  if (id == "KeyTime" && size >= kArrayHead && properties[0] == 'l') {
    std::uint32_t count, encoding;
    std::memcpy(&count, properties + 1, sizeof count);
    std::memcpy(&encoding, properties + 5, sizeof encoding);
    if (encoding != 0 || count > (size - kArrayHead) / kValue) return;
    for (std::uint32_t i = 0; i < count; ++i) {
      std::int64_t time;
      std::memcpy(&time, properties + kArrayHead + kValue * i, kValue);
      time /= times.divisor;
      std::memcpy(properties + kArrayHead + kValue * i, &time, kValue);
    }
  } else if (id == "P" && size > kValue + 1 && properties[size - kValue - 1] == 'L' &&
             (text.find("LocalStop") != std::string_view::npos || text.find("ReferenceStop") != std::string_view::npos)) {
    std::memcpy(properties + size - kValue, &times.stop, kValue);
  }
}

/// Copies the nodes from `at` to `end`; the record of zeros that ends a list is left to the caller.
bool copy_nodes(std::string_view in, std::size_t& at, std::size_t end, Times times, std::string& out, int depth) {
  if (depth > kDeepest) return false;
  while (at < end) {
    if (end - at < kRecord) return false;
    if (all_zero(in.substr(at, kRecord))) {
      at += kRecord;
      return true;
    }
    const std::uint64_t node_end = word(in, at), properties = word(in, at + 16);
    const std::size_t name = static_cast<unsigned char>(in[at + 24]);
    const std::size_t head = kRecord + name;
    if (node_end > end || node_end <= at || head > node_end - at || properties > node_end - at - head) return false;
    const std::size_t begin = out.size();
    // These are lists for every reader, be they empty or not.
    const std::string_view id = in.substr(at + kRecord, name);
    const bool list = at + head + properties < node_end || id == "AnimationStack" || id == "AnimationLayer";
    out.append(in.substr(at, head + properties));
    mend_times(id, out.data() + begin + head, properties, times);
    at += head + properties;
    if (at < node_end && (!copy_nodes(in, at, node_end, times, out, depth + 1) || at != node_end)) return false;
    if (list) out.append(kRecord, '\0');
    const std::uint64_t new_end = out.size();
    std::memcpy(out.data() + begin, &new_end, sizeof new_end);
  }
  return true;
}

}  // namespace

std::optional<std::string> repair_fbx(std::string_view bytes, std::int64_t time_divisor, std::int64_t stop) {
  if (bytes.size() < kHeader || bytes.substr(0, kMagic.size()) != kMagic) return std::nullopt;
  std::uint32_t version;
  std::memcpy(&version, bytes.data() + kMagic.size(), sizeof version);
  if (version < kFirst64) return std::nullopt;
  std::string out(bytes.substr(0, kHeader));
  std::size_t at = kHeader;
  if (!copy_nodes(bytes, at, bytes.size(), {time_divisor, stop}, out, 0)) return std::nullopt;
  out.append(kRecord, '\0');
  out.append(bytes.substr(at));  // the footer
  return out;
}

}  // namespace booth::daemon
