// Zip archives and the arrays in them: bytes as they come, and archives with right checksums around members of any bytes.
#include <zlib.h>

#include <stdexcept>
#include <string>

#include "daemon/io/npz.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::require;

void look(const NpzArray& a) {
  if (a.type == NpzType::text) {
    require(a.texts.size() == a.size(), "there are as many texts as the shape says");
    return;
  }
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a.number(i);
  require(a.size() <= a.bytes.size() || sum == sum || sum != sum, "all elements are there");
}

void read(std::string_view archive) {
  try {
    const NpzReader file(archive, "x");
    for (const auto& key : file.keys()) {
      look(file.array(key));
      try {
        (void)file.numbers(key, {0, 3});
        (void)file.integers(key, {}, -1, 7);
        (void)file.text(key);
      } catch (const std::runtime_error& e) {
        require(std::string(e.what()).starts_with("x: "), "the sentence names the file");
      }
    }
  } catch (const std::runtime_error& e) {
    require(std::string(e.what()).starts_with("x: "), "the sentence names the file");
  }
}

void put(std::string& out, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(std::uint64_t{value} >> (8 * i) & 0xff);
}

/// Headers as zip has them; `edit` is added to one of their fields, so that most archives are whole and some are not.
std::string zip_of(booth::fuzz::Input& in) {
  std::string body, directory;
  std::uint32_t members = 0;
  const unsigned edit = in.u8();
  for (; !in.empty() && members < 4; ++members) {
    const auto name_bytes = in.bytes(in.u8() % 8), contents_bytes = in.bytes(in.u16() % 400);
    const std::string name = std::string(reinterpret_cast<const char*>(name_bytes.data()), name_bytes.size()) + ".npy";
    const std::string contents(reinterpret_cast<const char*>(contents_bytes.data()), contents_bytes.size());
    const auto sum = static_cast<std::uint32_t>(::crc32(0, reinterpret_cast<const Bytef*>(contents.data()), static_cast<uInt>(contents.size())));
    const auto at = static_cast<std::uint32_t>(body.size()), length = static_cast<std::uint32_t>(contents.size());
    std::string common;
    put(common, 20, 2);                                                         // version needed
    put(common, 0, 2);                                                          // flags
    put(common, edit == 1 ? 8 : 0, 2);                                          // method
    put(common, 0, 4);                                                          // time
    put(common, sum, 4);                                                        // checksum
    put(common, length, 4);                                                     // packed
    put(common, edit == 2 ? length + 1 : edit == 3 ? 0xFFFFFFFFu : length, 4);  // unpacked
    put(common, static_cast<std::uint32_t>(name.size()), 2);
    put(common, 0, 2);  // extra
    put(body, 0x04034b50, 4);
    body += common + name + contents;
    put(directory, 0x02014b50, 4);
    put(directory, 20, 2);  // version made by
    directory += common;
    put(directory, 0, 2 + 2 + 2);  // comment, disk, attributes
    put(directory, 0, 4);
    put(directory, edit == 4 ? at + 1000 : at, 4);
    directory += name;
  }
  std::string out = body + directory;
  put(out, 0x06054b50, 4);
  put(out, 0, 4);
  put(out, members, 2);
  put(out, edit == 5 ? members + 9 : members, 2);
  put(out, static_cast<std::uint32_t>(directory.size()), 4);
  put(out, static_cast<std::uint32_t>(body.size()) + (edit == 6 ? 3 : 0), 4);
  put(out, 0, 2);
  return out;
}

void read_single(const std::string& bytes) {
  static const booth::fuzz::Scratch scratch;
  try {
    look(read_npy(scratch.put("a.npy", bytes)));
  } catch (const std::runtime_error& e) {
    require(std::string(e.what()).find("a.npy") != std::string::npos, "the sentence names the file");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string raw(reinterpret_cast<const char*>(data), size);
  read(raw);
  read_single(raw);
  read_single(std::string("\x93NUMPY\x01\x00", 8) + raw);
  booth::fuzz::Input in(data, size);
  read(zip_of(in));
  return 0;
}
