// Reads the plain IDL that ours is written in: lines, no preprocessor, comments behind members and above structs.
#include "tests/house/idl_page.hpp"

#include <sstream>

namespace booth::tests {
namespace {

std::string trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t"), end = text.find_last_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
}

/// "geometry_msgs::msg::dds_::Point_", where it stands in `text` -> "geometry_msgs/msg/Point": ROS 2's types under the names that ROS 2 gives them.
std::string with_ros_names(std::string text) {
  const std::string mark = "::msg::dds_::";
  for (std::size_t at; (at = text.find(mark)) != std::string::npos;) {
    text.replace(at, mark.size(), "/msg/");
    const auto end = text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", at + 5);
    if (end != std::string::npos && text[end] == '_') text.erase(end, 1);
  }
  return text;
}

/// "double q[DOFS]" -> member "q", type "double[DOFS]".
std::string member_row(std::string declaration, const std::string& meaning) {
  const bool key = declaration.rfind("@key ", 0) == 0;
  if (key) declaration = declaration.substr(5);
  const auto name_begin = declaration.find_last_of(' ') + 1;
  std::string name = declaration.substr(name_begin), type = trimmed(declaration.substr(0, name_begin));
  if (const auto bracket = name.find('['); bracket != std::string::npos) {
    type += name.substr(bracket);
    name.resize(bracket);
  }
  for (const std::string root = "::booth::msg::"; type.find(root) != std::string::npos;) type.erase(type.find(root), root.size());
  return "| `" + name + "` | `" + with_ros_names(type) + "` | " + (key ? "key. " : "") + meaning + " |\n";
}

}  // namespace

std::string types_of_idl(const std::string& idl) {
  std::string out, comment, module, constants, enums;
  std::istringstream lines(idl);
  bool in_struct = false;
  for (std::string raw; std::getline(lines, raw);) {
    const auto slashes = raw.find("//");
    const std::string code = trimmed(raw.substr(0, slashes)), note = slashes == std::string::npos ? "" : trimmed(raw.substr(slashes + 2));
    if (code.empty()) {
      comment = note.empty() ? "" : comment + (comment.empty() ? "" : " ") + note;
    } else if (code.rfind("const ", 0) == 0) {
      const auto equals = code.find(" = ");
      const std::string name = code.substr(code.find_last_of(' ', equals - 1) + 1, equals - code.find_last_of(' ', equals - 1) - 1);
      constants += "| `" + name + "` | " + code.substr(equals + 3, code.size() - equals - 4) + " |\n";
    } else if (code.rfind("enum ", 0) == 0) {
      const auto brace = code.find('{');
      enums += "| `" + trimmed(code.substr(5, brace - 5)) + "` | " + trimmed(code.substr(brace + 1, code.find('}') - brace - 1)) + " |\n";
    } else if (code.rfind("module ", 0) == 0) {
      module = code.find("dds_") == std::string::npos ? "" : code.substr(7, code.find(' ', 7) - 7) + "::msg::dds_::";
    } else if (code.rfind("struct ", 0) == 0) {
      out += "\n### " + with_ros_names(module + trimmed(code.substr(7, code.find('{') - 7))) + "\n\n" + (comment.empty() ? "" : comment + "\n\n") +
             "| member | type | meaning |\n|---|---|---|\n";
      in_struct = true;
    } else if (in_struct && code.back() == ';' && code[0] != '}') {
      out += member_row(code.substr(0, code.size() - 1), note);
    }
    if (code.rfind("};", 0) == 0) in_struct = false;
    if (!code.empty() && code[0] != '@') comment.clear();
  }
  if (!constants.empty()) constants = "\n| constant | value |\n|---|---|\n" + constants;
  if (!enums.empty()) enums = "\n| enumeration | values, from 0 |\n|---|---|\n" + enums;
  return constants + enums + out;
}

}  // namespace booth::tests
