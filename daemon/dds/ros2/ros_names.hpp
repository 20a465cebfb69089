// Names that ROS 2 accepts, made from names that a booth and its cameras may have.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace booth::daemon {

/// `name` as one token of a ROS 2 name: letters, digits and single underscores, beginning with a letter and ending with no underscore. Names that are such
/// a token stay what they are; others may meet ("a-b" and "a_b" are both a_b). Never empty.
std::string ros_token(std::string_view name);

/// Tokens of `names`, made different from each other by a number behind those that would be alike.
std::vector<std::string> ros_tokens(const std::vector<std::string>& names);

/// Why `name_space` is no namespace in which topics can be ("" or "a" or "/a/b": tokens between slashes); empty when it is one.
std::string ros_namespace_problem(std::string_view name_space);

/// Topics and frames of one booth. Frames of two booths differ as long as their tokens do.
struct RosNames {
  std::string id;                    ///< of the booth's one body: the booth's token
  std::string tracked, body, stage;  ///< topic of the ids; topic of the body without the last part; frame of the booth

  RosNames(std::string_view booth, std::string_view name_space);
  /// The topic `.../bodies/<id>/<leaf>`.
  std::string body_topic(std::string_view leaf) const { return body + "/" + std::string(leaf); }
  /// The frame `<link>_<id>`.
  std::string frame(std::string_view link) const { return std::string(link) + "_" + id; }
};

}  // namespace booth::daemon
