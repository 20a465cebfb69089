// PCD (the Point Cloud Library's format): text header, then text, binary rows, or LZF-compressed columns.
#include <cstring>

#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/mesh_file.hpp"
#include "daemon/io/text_scanner.hpp"

namespace booth::daemon {
namespace {

struct Field {
  std::string name;
  std::uint64_t size = 4, count = 1;
  char type = 'F';
  int slot = -1;             ///< 0-2 position, 3-5 normal
  std::uint64_t offset = 0;  ///< bytes from the beginning of a row, or of the columns
};

struct Header {
  std::vector<Field> fields;
  std::uint64_t points = 0, row_bytes = 0;
  std::string data;
};

int slot_named(std::string_view name) {
  static constexpr std::array<std::string_view, 6> names{"x", "y", "z", "normal_x", "normal_y", "normal_z"};
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] == name) return static_cast<int>(i);
  return -1;
}

template <typename T>
T number(TextScanner& text, std::string_view word) {
  T value{};
  if (!parse_number(word, value)) throw ParseError(text.where() + ": '" + std::string(word.substr(0, 40)) + "' is not a number that is allowed here");
  return value;
}

Header parse_header(TextScanner& text) {
  Header h;
  std::uint64_t width = 0, height = 1;
  bool points_seen = false;
  while (h.data.empty()) {
    if (!text.next_line() || text.line_number() > 100) throw ParseError("the header has no DATA line");
    const std::string_view key = text.word();
    if (key.empty() || key.front() == '#' || key == "VERSION" || key == "VIEWPOINT") continue;
    const auto each = [&](auto&& set) {
      for (Field& f : h.fields) set(f, text.word());
    };
    if (key == "FIELDS" || key == "COLUMNS") {
      for (std::string_view w = text.word(); !w.empty() && h.fields.size() < 64; w = text.word()) {
        h.fields.emplace_back();
        h.fields.back().name = w;
        h.fields.back().slot = slot_named(w);
      }
    } else if (key == "SIZE") {
      each([&](Field& f, std::string_view w) { f.size = number<std::uint8_t>(text, w); });
    } else if (key == "TYPE") {
      each([&](Field& f, std::string_view w) { f.type = w.empty() ? '?' : w.front(); });
    } else if (key == "COUNT") {
      each([&](Field& f, std::string_view w) { f.count = number<std::uint16_t>(text, w); });
    } else if (key == "WIDTH") {
      width = number<std::uint32_t>(text, text.word());
    } else if (key == "HEIGHT") {
      height = number<std::uint32_t>(text, text.word());
    } else if (key == "POINTS") {
      h.points = number<std::uint64_t>(text, text.word());
      points_seen = true;
    } else if (key == "DATA") {
      h.data = text.word();
    } else {
      throw ParseError(text.where() + ": unknown keyword '" + std::string(key.substr(0, 40)) + "'");
    }
  }
  if (!points_seen) h.points = width * height;
  std::array<int, 3> times{};
  for (Field& f : h.fields) {
    f.offset = h.row_bytes;
    h.row_bytes += f.size * f.count;
    if (f.slot < 0) continue;
    if (f.slot < 3) ++times[static_cast<std::size_t>(f.slot)];
    if (f.type != 'F' || f.count != 1 || (f.size != 4 && f.size != 8)) throw ParseError("field " + f.name + " is not a single float or double");
  }
  if (times != std::array<int, 3>{1, 1, 1}) throw ParseError("it needs the fields x, y and z, each once");
  return h;
}

float float_at(const char* p, std::uint64_t size) {
  if (size == 8) {
    double d;
    std::memcpy(&d, p, sizeof d);
    return static_cast<float>(d);
  }
  float f;
  std::memcpy(&f, p, sizeof f);
  return f;
}

/// LZF: a control byte below 32 announces that many literals plus one; others a copy from what was already written.
std::string lzf_expand(std::string_view in, std::size_t size) {
  std::string out;
  out.reserve(size);
  const auto broken = [] { return ParseError("the compressed part is broken"); };
  std::size_t i = 0;
  const auto byte = [&]() -> std::size_t {
    if (i == in.size()) throw broken();
    return static_cast<unsigned char>(in[i++]);
  };
  while (i < in.size()) {
    const std::size_t control = byte();
    if (control < 32) {
      const std::size_t n = control + 1;
      if (in.size() - i < n || size - out.size() < n) throw broken();
      out.append(in.substr(i, n));
      i += n;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) length += byte();
    length += 2;
    const std::size_t back = ((control & 31) << 8 | byte()) + 1;
    if (back > out.size() || size - out.size() < length) throw broken();
    // Byte by byte: source and destination may overlap, which is how runs are written.
    for (std::size_t k = 0; k < length; ++k) out.push_back(out[out.size() - back]);
  }
  if (out.size() != size) throw broken();
  return out;
}

void finish(RawCloud& out, const Header& h) {
  int normal_fields = 0;
  for (const Field& f : h.fields) normal_fields += f.slot >= 3;
  if (normal_fields != 3) out.normals.clear();
}

}  // namespace

RawCloud parse_pcd(std::string_view bytes) {
  TextScanner text(bytes);
  const Header h = parse_header(text);
  RawCloud out;
  const auto make_room = [&] { out.points.resize(h.points), out.normals.resize(h.points); };
  const auto put = [&](std::uint64_t i, int slot, float value) { (slot < 3 ? out.points : out.normals)[i][static_cast<std::size_t>(slot % 3)] = value; };
  if (h.data == "ascii") {
    std::uint64_t values = 0;  // of a point: each takes a digit and what parts it from the next
    for (const Field& f : h.fields) values += f.count;
    check_count(h.points, 2 * values, text.rest().size() + 1, "points");
    make_room();
    for (std::uint64_t i = 0; i < h.points; ++i) {
      if (!text.next_line()) throw ParseError("it ends early, after " + text.where());
      for (const Field& f : h.fields)
        for (std::uint64_t k = 0; k < f.count; ++k) {
          const std::string_view w = text.word();
          if (f.slot >= 0) put(i, f.slot, number<float>(text, w));
        }
    }
  } else if (h.data == "binary") {
    const std::string_view rows = text.rest();
    check_count(h.points, h.row_bytes, rows.size(), "points");
    make_room();
    for (std::uint64_t i = 0; i < h.points; ++i)
      for (const Field& f : h.fields)
        if (f.slot >= 0) put(i, f.slot, float_at(rows.data() + i * h.row_bytes + f.offset, f.size));
  } else if (h.data == "binary_compressed") {
    std::string_view packed = text.rest();
    if (packed.size() < 8) throw ParseError("it ends early, before the compressed part");
    std::array<std::uint32_t, 2> sizes;  // packed, unpacked
    std::memcpy(sizes.data(), packed.data(), sizeof sizes);
    packed.remove_prefix(8);
    if (sizes[0] > packed.size()) throw ParseError("it ends early, in the compressed part");
    // LZF cannot shrink more than about 1:130: a larger claim is an attempt to make us allocate.
    if (sizes[1] / 150 > sizes[0]) throw ParseError("the compressed part claims an impossible size");
    check_count(h.points, h.row_bytes, sizes[1], "points");
    const std::string columns = lzf_expand(packed.substr(0, sizes[0]), sizes[1]);
    make_room();
    for (const Field& f : h.fields)
      for (std::uint64_t i = 0; f.slot >= 0 && i < h.points; ++i) put(i, f.slot, float_at(columns.data() + f.offset * h.points + i * f.size, f.size));
  } else {
    throw ParseError("DATA is '" + h.data.substr(0, 40) + "', known are ascii, binary and binary_compressed");
  }
  finish(out, h);
  return out;
}

}  // namespace booth::daemon
