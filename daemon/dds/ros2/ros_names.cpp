// ROS 2's rules for names of topics; REP-155 for what stands below /humans.
#include "daemon/dds/ros2/ros_names.hpp"

#include <algorithm>

namespace booth::daemon {
namespace {

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

std::string ros_token(std::string_view name) {
  std::string out;
  for (const char c : name) {
    if (is_letter(c) || is_digit(c))
      out += c;
    else if (!out.empty() && out.back() != '_')  // none at the beginning: ROS 2 hides such topics
      out += '_';
  }
  while (!out.empty() && out.back() == '_') out.pop_back();
  if (out.empty()) return "booth";
  return is_letter(out.front()) ? out : "b" + out;
}

std::vector<std::string> ros_tokens(const std::vector<std::string>& names) {
  std::vector<std::string> out;
  for (const auto& name : names) {
    const std::string token = ros_token(name);
    std::string unique = token;
    for (int n = 2; std::find(out.begin(), out.end(), unique) != out.end(); ++n) unique = token + "_" + std::to_string(n);
    out.push_back(std::move(unique));
  }
  return out;
}

std::string ros_namespace_problem(std::string_view name_space) {
  constexpr const char* kRule = "must be empty or like \"hall\" or \"/site/hall\": letters, digits and single underscores, each part beginning with a letter";
  if (name_space.empty()) return "";
  if (name_space.size() > 64) return "must have at most 64 characters";
  if (name_space.front() == '/') name_space.remove_prefix(1);
  while (true) {
    const auto slash = name_space.find('/');
    const std::string_view part = name_space.substr(0, slash);
    if (part.empty() || ros_token(part) != part) return kRule;
    if (slash == std::string_view::npos) return "";
    name_space.remove_prefix(slash + 1);
  }
}

RosNames::RosNames(std::string_view booth, std::string_view name_space) : id(ros_token(booth)) {
  std::string humans(name_space);
  if (!humans.empty() && humans.front() != '/') humans.insert(0, "/");
  humans += "/humans/bodies";
  tracked = humans + "/tracked";
  body = humans + "/" + id;
  stage = "stage_" + id;
}

}  // namespace booth::daemon
