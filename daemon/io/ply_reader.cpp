// PLY: a text header that declares elements and their properties, then rows in text or binary of either byte order.
#include <bit>
#include <cstring>
#include <optional>
#include <utility>

#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/mesh_file.hpp"
#include "daemon/io/text_scanner.hpp"

namespace booth::daemon {
namespace {

enum class Encoding { ascii, little, big };
enum class Type : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

constexpr std::array<std::size_t, 8> kBytes{1, 1, 2, 2, 4, 4, 4, 8};
std::size_t bytes_of(Type t) { return kBytes[static_cast<std::size_t>(t)]; }

std::optional<Type> type_named(std::string_view name) {
  struct Name {
    std::string_view text;
    Type type;
  };
  static constexpr std::array<Name, 16> names{{{"char", Type::i8},
                                               {"int8", Type::i8},
                                               {"uchar", Type::u8},
                                               {"uint8", Type::u8},
                                               {"short", Type::i16},
                                               {"int16", Type::i16},
                                               {"ushort", Type::u16},
                                               {"uint16", Type::u16},
                                               {"int", Type::i32},
                                               {"int32", Type::i32},
                                               {"uint", Type::u32},
                                               {"uint32", Type::u32},
                                               {"float", Type::f32},
                                               {"float32", Type::f32},
                                               {"double", Type::f64},
                                               {"float64", Type::f64}}};
  for (const Name& n : names)
    if (n.text == name) return n.type;
  return std::nullopt;
}

/// Where a scalar property of a vertex goes: 0-2 position, 3-5 normal.
int slot_named(std::string_view name) {
  static constexpr std::array<std::string_view, 6> names{"x", "y", "z", "nx", "ny", "nz"};
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] == name) return static_cast<int>(i);
  return -1;
}

struct Property {
  std::string name;
  Type type{};
  std::optional<Type> count_type;  ///< set for lists
  int slot = -1;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Encoding encoding = Encoding::ascii;
  std::vector<Element> elements;
};

Header parse_header(TextScanner& text) {
  Header header;
  bool format_seen = false;
  if (!text.next_line() || text.word() != "ply") throw ParseError("it does not begin with 'ply'");
  while (true) {
    if (!text.next_line()) throw ParseError("the header has no end_header");
    if (text.line_number() > 1000) throw ParseError("the header has more than 1000 lines");
    const std::string_view key = text.word();
    if (key == "end_header") break;
    if (key.empty() || key == "comment" || key == "obj_info") continue;
    if (key == "format") {
      const std::string_view name = text.word();
      if (name == "ascii")
        header.encoding = Encoding::ascii;
      else if (name == "binary_little_endian")
        header.encoding = Encoding::little;
      else if (name == "binary_big_endian")
        header.encoding = Encoding::big;
      else
        throw ParseError(text.where() + ": unknown format '" + std::string(name.substr(0, 40)) + "'");
      format_seen = true;
    } else if (key == "element") {
      Element e;
      e.name = text.word();
      if (e.name.empty() || !parse_number(text.word(), e.count)) throw ParseError(text.where() + ": an element needs a name and a count");
      header.elements.push_back(std::move(e));
    } else if (key == "property") {
      if (header.elements.empty()) throw ParseError(text.where() + ": a property before any element");
      Property p;
      std::string_view type = text.word();
      if (type == "list") {
        p.count_type = type_named(text.word());
        if (!p.count_type || *p.count_type == Type::f32 || *p.count_type == Type::f64)
          throw ParseError(text.where() + ": a list needs an integer type for its count");
        type = text.word();
      }
      const auto known = type_named(type);
      if (!known) throw ParseError(text.where() + ": unknown type '" + std::string(type.substr(0, 40)) + "'");
      p.type = *known;
      p.name = text.word();
      if (!p.count_type && header.elements.back().name == "vertex") p.slot = slot_named(p.name);
      header.elements.back().properties.push_back(std::move(p));
    } else {
      throw ParseError(text.where() + ": unknown keyword '" + std::string(key.substr(0, 40)) + "'");
    }
  }
  if (!format_seen) throw ParseError("the header has no format line");
  return header;
}

/// Values one after the other, from text or from bytes; both say where they stopped when the file ends early.
class AsciiValues {
 public:
  explicit AsciiValues(TextScanner text) : text_(text) {}
  double next(Type) {
    std::string_view w = text_.word();
    while (w.empty()) {
      if (!text_.next_line()) throw ParseError("it ends early, after " + text_.where());
      w = text_.word();
    }
    double value = 0;
    if (!parse_number(w, value)) throw ParseError(text_.where() + ": '" + std::string(w.substr(0, 40)) + "' is not a number");
    return value;
  }
  std::uint64_t bytes_left() const { return text_.line().size() + text_.rest().size() + 1; }
  static std::uint64_t least_bytes(Type) { return 2; }  // a digit and a blank

 private:
  TextScanner text_;
};

class BinaryValues {
 public:
  BinaryValues(std::string_view bytes, bool swap) : bytes_(bytes), swap_(swap) {}
  double next(Type type) {
    const std::size_t n = bytes_of(type);
    if (bytes_.size() < n) throw ParseError("it ends early, in the binary part");
    std::array<char, 8> raw{};
    std::memcpy(raw.data(), bytes_.data(), n);
    bytes_.remove_prefix(n);
    if (swap_)
      for (std::size_t i = 0; i < n / 2; ++i) std::swap(raw[i], raw[n - 1 - i]);
    switch (type) {
      case Type::i8:
        return read<std::int8_t>(raw);
      case Type::u8:
        return read<std::uint8_t>(raw);
      case Type::i16:
        return read<std::int16_t>(raw);
      case Type::u16:
        return read<std::uint16_t>(raw);
      case Type::i32:
        return read<std::int32_t>(raw);
      case Type::u32:
        return read<std::uint32_t>(raw);
      case Type::f32:
        return static_cast<double>(read<float>(raw));
      case Type::f64:
        return read<double>(raw);
    }
    return 0;
  }
  std::uint64_t bytes_left() const { return bytes_.size(); }
  static std::uint64_t least_bytes(Type type) { return bytes_of(type); }

 private:
  template <typename T>
  static T read(const std::array<char, 8>& raw) {
    T value;
    std::memcpy(&value, raw.data(), sizeof value);
    return value;
  }
  std::string_view bytes_;
  bool swap_;
};

template <typename Values>
void read_rows(Values& values, const Header& header, RawCloud& out) {
  for (const Element& element : header.elements) {
    std::uint64_t least = 0;
    for (const Property& p : element.properties) least += p.count_type ? values.least_bytes(*p.count_type) : values.least_bytes(p.type);
    if (least == 0) continue;  // no properties: rows without contents
    check_count(element.count, least, values.bytes_left(), element.name + " rows");
    const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
    bool normals = is_vertex;
    if (is_vertex) {
      std::array<int, 6> times{};
      for (const Property& p : element.properties)
        if (p.slot >= 0) ++times[static_cast<std::size_t>(p.slot)];
      for (std::size_t i = 0; i < 3; ++i)
        if (times[i] != 1) throw ParseError(std::string("element vertex has ") + (times[i] == 0 ? "no" : "more than one") + " property " + "xyz"[i]);
      normals = times[3] == 1 && times[4] == 1 && times[5] == 1;
      out.points.reserve(element.count);
      if (normals) out.normals.reserve(element.count);
    }
    std::vector<std::int64_t> corners;
    for (std::uint64_t row = 0; row < element.count; ++row) {
      std::array<float, 6> slots{};
      for (const Property& p : element.properties) {
        if (!p.count_type) {
          const double value = values.next(p.type);
          if (p.slot >= 0) slots[static_cast<std::size_t>(p.slot)] = static_cast<float>(value);
          continue;
        }
        const double length = values.next(*p.count_type);
        if (!(length >= 0)) throw ParseError(element.name + " row " + std::to_string(row) + " has a list of negative length");
        check_count(static_cast<std::uint64_t>(length), values.least_bytes(p.type), values.bytes_left(), "entries of a list");
        const bool indices = is_face && (p.name == "vertex_indices" || p.name == "vertex_index");
        corners.clear();
        for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(length); ++i) {
          const double value = values.next(p.type);
          if (indices) corners.push_back(value >= -1 && value < 1e10 ? static_cast<std::int64_t>(value) : -1);
        }
        if (indices) append_polygon(corners, out.points.size(), "face " + std::to_string(row), out.faces);
      }
      if (is_vertex) {
        out.points.push_back({slots[0], slots[1], slots[2]});
        if (normals) out.normals.push_back({slots[3], slots[4], slots[5]});
      }
    }
  }
}

}  // namespace

RawCloud parse_ply(std::string_view bytes) {
  TextScanner text(bytes);
  const Header header = parse_header(text);
  bool has_vertices = false;
  for (const Element& e : header.elements) {
    if (e.name == "vertex" && std::exchange(has_vertices, true)) throw ParseError("it declares element vertex twice");
    if (e.name == "face" && !has_vertices) throw ParseError("it declares faces before vertices");
  }
  if (!has_vertices) throw ParseError("it has no element vertex");
  RawCloud out;
  if (header.encoding == Encoding::ascii) {
    AsciiValues values(text);
    // The header's last line is used up; values begin on the next.
    read_rows(values, header, out);
  } else {
    BinaryValues values(text.rest(), (header.encoding == Encoding::big) == (std::endian::native == std::endian::little));
    read_rows(values, header, out);
  }
  return out;
}

}  // namespace booth::daemon
