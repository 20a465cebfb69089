// SHA-256 over a description of the type and of all types inside it, as JSON with fixed spacing and order of keys (REP-2011; type_description_interfaces).
#include "tests/daemon/dds/ros2/rihs01.hpp"

#include <array>
#include <cstdio>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

struct Field {
  std::string name, type;  ///< "double", or "std_msgs/msg/Header"
  bool sequence = false;
};
using Types = std::map<std::string, std::vector<Field>>;

/// "std_msgs::msg::dds_::Header_" -> "std_msgs/msg/Header".
std::string ros_name(const std::string& scoped) {
  const auto package = scoped.find("::msg::dds_::");
  if (package == std::string::npos || scoped.back() != '_') throw std::runtime_error("no message: " + scoped);
  return scoped.substr(0, package) + "/msg/" + scoped.substr(package + 13, scoped.size() - package - 14);
}

const std::map<std::string, int>& primitives() {  // constants of type_description_interfaces/msg/FieldType
  static const std::map<std::string, int> all{{"uint8", 3}, {"int32", 6}, {"uint32", 7}, {"double", 11}, {"boolean", 15}, {"string", 17}};
  return all;
}
constexpr int kNested = 1, kUnboundedSequence = 144;

Types read(const std::string& idl) {
  Types out;
  std::string package;
  std::vector<Field>* type = nullptr;
  std::istringstream lines(idl);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line.substr(0, line.find("//")));
    std::string first, second;
    words >> first >> second;
    if (first.empty() || first[0] == '@' || first[0] == '}') continue;
    if (first == "module") {
      package = second;
    } else if (first == "struct") {
      type = &out[package + "/msg/" + second.substr(0, second.size() - 1)];
    } else if (type != nullptr && !second.empty() && second.back() == ';') {
      Field field{.name = second.substr(0, second.size() - 1), .type = first};
      if (first.rfind("sequence<", 0) == 0) field.sequence = true, field.type = first.substr(9, first.size() - 10);
      if (!primitives().contains(field.type)) field.type = ros_name(field.type);
      type->push_back(field);
    } else {
      throw std::runtime_error("not understood: " + line);
    }
  }
  return out;
}

std::string describe(const Types& types, const std::string& name) {
  std::string out = "{\"type_name\": \"" + name + "\", \"fields\": [";
  bool first = true;
  for (const Field& f : types.at(name)) {
    const auto known = primitives().find(f.type);
    const bool nested = known == primitives().end();
    out += std::string(first ? "" : ", ") + "{\"name\": \"" + f.name +
           "\", \"type\": {\"type_id\": " + std::to_string((nested ? kNested : known->second) + (f.sequence ? kUnboundedSequence : 0)) +
           ", \"capacity\": 0, \"string_capacity\": 0, \"nested_type_name\": \"" + (nested ? f.type : "") + "\"}}";
    first = false;
  }
  return out + "]}";
}

void add_inside(const Types& types, const std::string& name, std::set<std::string>& out) {
  for (const Field& f : types.at(name))
    if (!primitives().contains(f.type) && out.insert(f.type).second) add_inside(types, f.type, out);
}

std::string sha256(const TemporaryFolder& folder, const std::string& text) {
  const auto file = folder.write("text", text);
  std::FILE* pipe = ::popen(("sha256sum '" + file.string() + "'").c_str(), "r");
  std::array<char, 65> digest{};
  const bool read = pipe != nullptr && std::fread(digest.data(), 1, 64, pipe) == 64;
  if (pipe != nullptr) ::pclose(pipe);
  if (!read) throw std::runtime_error("sha256sum said nothing");
  return digest.data();
}

}  // namespace

std::map<std::string, std::string> rihs01_of_idl(const std::string& idl) {
  const Types types = read(idl);
  const TemporaryFolder folder;
  std::map<std::string, std::string> out;
  for (const auto& [name, fields] : types) {
    std::set<std::string> inside;
    add_inside(types, name, inside);
    std::string text = "{\"type_description\": " + describe(types, name) + ", \"referenced_type_descriptions\": [";
    for (auto it = inside.begin(); it != inside.end(); ++it) text += (it == inside.begin() ? "" : ", ") + describe(types, *it);
    out[name] = "RIHS01_" + sha256(folder, text + "]}");
  }
  return out;
}

}  // namespace booth::tests
