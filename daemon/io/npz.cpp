// Zip (stored or deflated members, central directory as the only authority), the .npy header's small dictionary, and half precision.
#include "daemon/io/npz.hpp"

#include <zlib.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"

namespace booth::daemon {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are copied as they stand");

constexpr std::uint32_t kLocalMark = 0x04034b50, kCentralMark = 0x02014b50, kEndMark = 0x06054b50;
constexpr std::size_t kLocalSize = 30, kCentralSize = 46, kEndSize = 22;
constexpr std::uint64_t kMostBytes = 512ull << 20;
constexpr std::size_t kMostMembers = 256, kMostTexts = 1'000'000;

struct TypeName {
  NpzType type;
  std::string_view descr;
  std::size_t bytes;
};
constexpr TypeName kTypes[] = {{NpzType::f2, "<f2", 2}, {NpzType::f4, "<f4", 4}, {NpzType::f8, "<f8", 8},
                               {NpzType::i4, "<i4", 4}, {NpzType::i8, "<i8", 8}, {NpzType::u1, "|u1", 1}};

std::size_t element_bytes(NpzType type) {
  for (const auto& t : kTypes)
    if (t.type == type) return t.bytes;
  return 0;
}

struct Malformed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <typename T>
T get(std::string_view bytes, std::size_t at) {
  if (at > bytes.size() || bytes.size() - at < sizeof(T)) throw Malformed("is cut off");
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

template <typename T>
void put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string_view slice(std::string_view bytes, std::uint64_t at, std::uint64_t size) {
  if (at > bytes.size() || size > bytes.size() - at) throw Malformed("is cut off");
  return bytes.substr(at, size);
}

std::string inflated(std::string_view packed, std::size_t size) {
  std::string out(size, '\0');
  z_stream stream{};
  if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw Malformed("cannot be unpacked: no memory");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(size);
  const int result = inflate(&stream, Z_FINISH);
  const bool whole = result == Z_STREAM_END && stream.total_out == size;
  inflateEnd(&stream);
  if (!whole) throw Malformed("is damaged: its compressed data does not unpack to the size it states");
  return out;
}

std::string deflated(std::string_view bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY) != Z_OK) throw std::runtime_error("zlib: no memory");
  std::string out(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::uint32_t checksum(std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

/// The value behind 'key': in a .npy header; views stay valid with the header.
std::string_view header_value(std::string_view header, std::string_view key) {
  std::string quoted("'");
  quoted.append(key).append("'");
  const auto at = header.find(quoted);
  if (at == std::string_view::npos) throw Malformed("has an array header without '" + std::string(key) + "'");
  const auto colon = header.find(':', at);
  if (colon == std::string_view::npos) throw Malformed("has a broken array header");
  auto value = header.substr(colon + 1);
  value.remove_prefix(std::min(value.find_first_not_of(' '), value.size()));
  return value;
}

std::string utf8(char32_t c) {
  std::string s;
  if (c < 0x80) {
    s += static_cast<char>(c);
  } else if (c < 0x800) {
    s += static_cast<char>(0xC0 | (c >> 6));
    s += static_cast<char>(0x80 | (c & 0x3F));
  } else if (c < 0x10000) {
    s += static_cast<char>(0xE0 | (c >> 12));
    s += static_cast<char>(0x80 | ((c >> 6) & 0x3F));
    s += static_cast<char>(0x80 | (c & 0x3F));
  } else {
    throw Malformed("has text outside the basic multilingual plane");
  }
  return s;
}

/// `texts_left`: how many the archive may still hold.
NpzArray parse_npy(std::string_view npy, std::uint64_t& texts_left) {
  if (!npy.starts_with("\x93NUMPY")) throw Malformed("is not a NumPy array");
  const auto version = get<std::uint8_t>(npy, 6);
  if (version != 1 && version != 2) throw Malformed("has NumPy format version " + std::to_string(version) + "; save it with numpy.savez");
  const std::size_t start = version == 1 ? 10 : 12;
  const std::size_t length = version == 1 ? get<std::uint16_t>(npy, 8) : get<std::uint32_t>(npy, 8);
  const auto header = slice(npy, start, length);
  const auto data = npy.substr(start + length);

  NpzArray array;
  if (header_value(header, "fortran_order").starts_with("True")) throw Malformed("is in Fortran order; save numpy.ascontiguousarray of it");
  auto shape = header_value(header, "shape");
  if (!shape.starts_with('(') || shape.find(')') == std::string_view::npos) throw Malformed("has a broken shape");
  shape = shape.substr(1, shape.find(')') - 1);
  std::uint64_t count = 1;
  while (!shape.empty()) {
    shape.remove_prefix(std::min(shape.find_first_not_of(" ,"), shape.size()));
    if (shape.empty()) break;
    std::uint64_t n = 0;
    const auto [end, error] = std::from_chars(shape.data(), shape.data() + shape.size(), n);
    if (error != std::errc() || array.shape.size() == 8) throw Malformed("has a broken shape");
    shape.remove_prefix(static_cast<std::size_t>(end - shape.data()));
    array.shape.push_back(n);
    if (n > kMostBytes || count * n > kMostBytes) throw Malformed("states an impossible size");
    count *= n;
  }

  auto descr = header_value(header, "descr");
  if (!descr.starts_with('\'') || descr.find('\'', 1) == std::string_view::npos) throw Malformed("has fields; expected a plain array");
  descr = descr.substr(1, descr.find('\'', 1) - 1);
  for (const auto& t : kTypes) {
    if (t.descr != descr) continue;
    array.type = t.type;
    if (data.size() != count * t.bytes)
      throw Malformed("holds " + std::to_string(data.size()) + " bytes, but its shape needs " + std::to_string(count * t.bytes));
    array.bytes = data;
    return array;
  }
  const bool wide = descr.starts_with("<U"), narrow = descr.starts_with("|S");
  std::size_t width = 0;
  if (wide || narrow) std::from_chars(descr.data() + 2, descr.data() + descr.size(), width);
  if ((!wide && !narrow) || width > 65536) throw Malformed("has type " + std::string(descr) + "; allowed are f2, f4, f8, i4, i8, u1 (little-endian) and text");
  const std::size_t step = width * (wide ? 4 : 1);
  // In memory a text takes more room than in the file, where it would take none.
  if (width == 0 && count > 1) throw Malformed("states " + std::to_string(count) + " texts of no letters");
  if (count > texts_left) throw Malformed("states " + std::to_string(count) + " texts; at most " + std::to_string(kMostTexts) + " are read of an archive");
  texts_left -= count;
  if (data.size() != count * step) throw Malformed("holds a different number of bytes than its shape needs");
  array.type = NpzType::text;
  for (std::uint64_t i = 0; i < count; ++i) {
    std::string text;
    for (std::size_t c = 0; c < width; ++c) {
      const char32_t code = wide ? get<char32_t>(data, i * step + 4 * c) : static_cast<unsigned char>(data[i * step + c]);
      if (code == 0) break;
      text += utf8(code);
    }
    array.texts.push_back(std::move(text));
  }
  return array;
}

std::string npy_header(std::string_view descr, const std::vector<std::size_t>& shape) {
  std::string text = "{'descr': '" + std::string(descr) + "', 'fortran_order': False, 'shape': (";
  for (std::size_t i = 0; i < shape.size(); ++i) text += std::to_string(shape[i]) + (shape.size() == 1 ? "," : i + 1 < shape.size() ? ", " : "");
  text += "), }";
  text.append(63 - (10 + text.size()) % 64, ' ');
  text += '\n';
  std::string npy("\x93NUMPY\x01\x00", 8);
  put(npy, static_cast<std::uint16_t>(text.size()));
  return npy + text;
}

}  // namespace

std::uint16_t half_from_float(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t sign = (bits >> 16) & 0x8000, magnitude = bits & 0x7fffffff;
  if (magnitude >= 0x7f800000) return static_cast<std::uint16_t>(sign | 0x7c00 | (magnitude > 0x7f800000 ? 0x200 : 0));
  if (magnitude >= 0x477ff000) return static_cast<std::uint16_t>(sign | 0x7c00);  // rounds beyond 65504
  if (magnitude < 0x38800000) {                                                   // subnormal: an integer multiple of 2^-24
    const float scaled = std::bit_cast<float>(magnitude) * 0x1p24f;
    return static_cast<std::uint16_t>(sign | static_cast<std::uint32_t>(std::nearbyint(scaled)));
  }
  const std::uint32_t rounded = magnitude + 0xfff + ((magnitude >> 13) & 1);
  return static_cast<std::uint16_t>(sign | ((rounded - 0x38000000) >> 13));
}

float float_from_half(std::uint16_t bits) {
  const float sign = bits & 0x8000 ? -1.0f : 1.0f;
  const int exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent == 0) return sign * std::ldexp(static_cast<float>(fraction), -24);
  if (exponent == 31) return fraction ? std::numeric_limits<float>::quiet_NaN() : sign * std::numeric_limits<float>::infinity();
  return sign * std::ldexp(static_cast<float>(1024 + fraction), exponent - 25);
}

std::size_t NpzArray::size() const {
  std::size_t n = 1;
  for (std::size_t s : shape) n *= s;
  return n;
}

double NpzArray::number(std::size_t i) const {
  switch (type) {
    case NpzType::f2:
      return static_cast<double>(float_from_half(get<std::uint16_t>(bytes, 2 * i)));
    case NpzType::f4:
      return static_cast<double>(get<float>(bytes, 4 * i));
    case NpzType::f8:
      return get<double>(bytes, 8 * i);
    case NpzType::i4:
      return get<std::int32_t>(bytes, 4 * i);
    case NpzType::i8:
      return static_cast<double>(get<std::int64_t>(bytes, 8 * i));
    case NpzType::u1:
      return get<std::uint8_t>(bytes, i);
    case NpzType::text:
      break;
  }
  throw std::logic_error("a text array has no numbers");
}

NpzReader::NpzReader(const std::filesystem::path& path) : name_(path.string()) {
  const std::string bytes = read_file_bytes(path, kMostBytes);
  parse(bytes);
}

NpzReader::NpzReader(std::string_view archive, std::string name) : name_(std::move(name)) { parse(archive); }

void NpzReader::parse(std::string_view archive) {
  std::string member = "archive";
  try {
    if (archive.size() < kEndSize) throw Malformed("is too short for an .npz archive");
    std::size_t end = archive.size() - kEndSize;  // a comment of up to 65535 bytes may follow the end record
    const std::size_t lowest = end > 65535 ? end - 65535 : 0;
    while (get<std::uint32_t>(archive, end) != kEndMark) {
      if (end == lowest) throw Malformed("is not an .npz archive, or is cut off");
      --end;
    }
    const std::size_t members = get<std::uint16_t>(archive, end + 10);
    if (members > kMostMembers) throw Malformed("states " + std::to_string(members) + " arrays; at most " + std::to_string(kMostMembers) + " are read");
    std::size_t at = get<std::uint32_t>(archive, end + 16);
    std::uint64_t total = 0, texts_left = kMostTexts;
    for (std::size_t i = 0; i < members; ++i) {
      if (get<std::uint32_t>(archive, at) != kCentralMark) throw Malformed("has a broken directory");
      const auto flags = get<std::uint16_t>(archive, at + 8), method = get<std::uint16_t>(archive, at + 10);
      const auto crc = get<std::uint32_t>(archive, at + 16), packed = get<std::uint32_t>(archive, at + 20), size = get<std::uint32_t>(archive, at + 24);
      const auto name_size = get<std::uint16_t>(archive, at + 28), extra = get<std::uint16_t>(archive, at + 30), comment = get<std::uint16_t>(archive, at + 32);
      const auto local = get<std::uint32_t>(archive, at + 42);
      member = "key '" + std::string(slice(archive, at + kCentralSize, name_size)) + "'";
      std::string key(slice(archive, at + kCentralSize, name_size));
      at += kCentralSize + name_size + extra + comment;
      if (!key.ends_with(".npy")) throw Malformed("is not a NumPy array");
      key.resize(key.size() - 4);
      for (char c : key)
        if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) > 0x7e) throw Malformed("has a name outside ASCII");
      member = "key '" + key + "'";
      if (flags & 1) throw Malformed("is encrypted");
      if ((total += size) > kMostBytes) throw Malformed("unpacks to more than 512 MiB");
      if (get<std::uint32_t>(archive, local) != kLocalMark) throw Malformed("does not stand where the directory says");
      const auto data =
          slice(archive, std::uint64_t{local} + kLocalSize + get<std::uint16_t>(archive, local + 26) + get<std::uint16_t>(archive, local + 28), packed);
      if (method != 0 && method != 8) throw Malformed("is packed by method " + std::to_string(method) + "; use numpy.savez or savez_compressed");
      if (method == 0 && packed != size) throw Malformed("states two sizes");
      // Deflate cannot shrink by more than about 1032 to 1.
      if (method == 8 && size / 1100 > packed) throw Malformed("states an impossible size");
      const std::string contents = method == 8 ? inflated(data, size) : std::string(data);
      if (checksum(contents) != crc) throw Malformed("is damaged: its checksum differs");
      if (!arrays_.emplace(key, parse_npy(contents, texts_left)).second) throw Malformed("stands there twice");
    }
  } catch (const Malformed& e) {
    throw std::runtime_error(name_ + ": " + member + " " + e.what());
  }
}

NpzArray read_npy(const std::filesystem::path& path) {
  const std::string bytes = read_file_bytes(path, kMostBytes);
  try {
    std::uint64_t texts_left = kMostTexts;
    return parse_npy(bytes, texts_left);
  } catch (const Malformed& e) {
    throw std::runtime_error(path.string() + ": " + e.what());
  }
}

std::vector<std::string> NpzReader::keys() const {
  std::vector<std::string> list;
  for (const auto& [key, array] : arrays_) list.push_back(key);
  return list;
}

void NpzReader::fail(const std::string& key, const std::string& what) const { throw std::runtime_error(name_ + ": key '" + key + "' " + what); }

const NpzArray& NpzReader::array(const std::string& key) const {
  const auto found = arrays_.find(key);
  if (found == arrays_.end()) fail(key, "is missing");
  return found->second;
}

std::vector<double> NpzReader::numbers(const std::string& key, std::span<const std::size_t> shape) const {
  const auto& a = array(key);
  if (a.type == NpzType::text) fail(key, "is text; expected numbers");
  const auto list = [](const auto& dims) {
    std::string text = "(";
    for (std::size_t d : dims) text += (text.size() > 1 ? ", " : "") + (d ? std::to_string(d) : std::string("any"));
    return text + ")";
  };
  bool fits = a.shape.size() == shape.size();
  for (std::size_t i = 0; fits && i < shape.size(); ++i) fits = shape[i] == 0 || shape[i] == a.shape[i];
  if (!fits) fail(key, "has shape " + list(a.shape) + ", expected " + list(shape));
  std::vector<double> values(a.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = a.number(i);
    if (!std::isfinite(values[i])) fail(key, "holds a value that is not finite (element " + std::to_string(i) + ")");
  }
  return values;
}

std::vector<int> NpzReader::integers(const std::string& key, std::initializer_list<std::size_t> shape, long low, long high) const {
  const auto values = numbers(key, shape);
  std::vector<int> list(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] != std::floor(values[i]) || values[i] < static_cast<double>(low) || values[i] > static_cast<double>(high))
      fail(key, "holds " + std::to_string(values[i]) + ", allowed are whole numbers from " + std::to_string(low) + " to " + std::to_string(high));
    list[i] = static_cast<int>(values[i]);
  }
  return list;
}

std::vector<std::string> NpzReader::texts(const std::string& key) const {
  const auto& a = array(key);
  if (a.type != NpzType::text) fail(key, "holds numbers; expected text");
  return a.texts;
}

std::string NpzReader::text(const std::string& key) const {
  const auto list = texts(key);
  if (list.size() != 1) fail(key, "holds " + std::to_string(list.size()) + " texts, expected one");
  return list[0];
}

void NpzWriter::add(const std::string& key, NpzType type, std::vector<std::size_t> shape, std::span<const double> values) {
  std::string_view descr;
  for (const auto& t : kTypes)
    if (t.type == type) descr = t.descr;
  std::size_t count = 1;
  for (std::size_t s : shape) count *= s;
  if (count != values.size() || descr.empty()) throw std::invalid_argument("npz: array '" + key + "' does not have the size of its shape, or is text");
  std::string npy = npy_header(descr, shape);
  npy.reserve(npy.size() + count * element_bytes(type));
  for (double v : values) {
    switch (type) {
      case NpzType::f2:
        put(npy, half_from_float(static_cast<float>(v)));
        break;
      case NpzType::f4:
        put(npy, static_cast<float>(v));
        break;
      case NpzType::f8:
        put(npy, v);
        break;
      case NpzType::i4:
        put(npy, static_cast<std::int32_t>(v));
        break;
      case NpzType::i8:
        put(npy, static_cast<std::int64_t>(v));
        break;
      case NpzType::u1:
        put(npy, static_cast<std::uint8_t>(v));
        break;
      case NpzType::text:
        break;
    }
  }
  members_.emplace_back(key + ".npy", std::move(npy));
}

void NpzWriter::add_texts(const std::string& key, const std::vector<std::string>& values, bool scalar) {
  std::size_t width = 1;
  for (const auto& v : values) width = std::max(width, v.size());
  std::string npy = npy_header("<U" + std::to_string(width), scalar ? std::vector<std::size_t>{} : std::vector<std::size_t>{values.size()});
  for (const auto& v : values)
    for (std::size_t i = 0; i < width; ++i) {
      const unsigned char c = i < v.size() ? static_cast<unsigned char>(v[i]) : 0;
      if (c > 0x7e) throw std::invalid_argument("npz: text of '" + key + "' is not ASCII");
      put(npy, static_cast<std::uint32_t>(c));
    }
  members_.emplace_back(key + ".npy", std::move(npy));
}

std::string NpzWriter::archive() const {
  std::string out, directory;
  for (const auto& member : members_) {
    const std::string &name = member.first, &contents = member.second;
    const std::string packed = deflated(contents);
    // Version 2.0, no flags, deflate, 1980-01-01 00:00; then checksum, sizes and the name's length.
    const auto common = [&](std::string& to) {
      put<std::uint16_t>(to, 20);
      put<std::uint16_t>(to, 0);
      put<std::uint16_t>(to, 8);
      put<std::uint16_t>(to, 0);
      put<std::uint16_t>(to, 0x21);
      put<std::uint32_t>(to, checksum(contents));
      put<std::uint32_t>(to, static_cast<std::uint32_t>(packed.size()));
      put<std::uint32_t>(to, static_cast<std::uint32_t>(contents.size()));
      put<std::uint16_t>(to, static_cast<std::uint16_t>(name.size()));
      put<std::uint16_t>(to, 0);
    };
    const auto offset = static_cast<std::uint32_t>(out.size());
    put(out, kLocalMark);
    common(out);
    out += name;
    out += packed;
    put(directory, kCentralMark);
    put<std::uint16_t>(directory, 20);
    common(directory);
    put<std::uint16_t>(directory, 0);  // comment
    put<std::uint16_t>(directory, 0);  // disk
    put<std::uint16_t>(directory, 0);  // internal attributes
    put<std::uint32_t>(directory, 0);  // external attributes
    put(directory, offset);
    directory += name;
  }
  const auto at = static_cast<std::uint32_t>(out.size());
  out += directory;
  put(out, kEndMark);
  put<std::uint32_t>(out, 0);
  put<std::uint16_t>(out, static_cast<std::uint16_t>(members_.size()));
  put<std::uint16_t>(out, static_cast<std::uint16_t>(members_.size()));
  put<std::uint32_t>(out, static_cast<std::uint32_t>(directory.size()));
  put<std::uint32_t>(out, at);
  put<std::uint16_t>(out, 0);
  return out;
}

void NpzWriter::save(const std::filesystem::path& path) const { write_file_atomically(path, archive()); }

}  // namespace booth::daemon
