// A person in letters: what a terminal can show of a skeleton.
#pragma once

#include <array>
#include <span>
#include <string>

namespace booth::daemon {

/// `joints`: the 24 of docs/reference/skeleton.md, booth frame, metres. Seen from the front: the person's left is on the right. Lines of `columns`
/// characters, each ending in a newline; about 2.2 m high and 2 m wide around the root.
std::string stick_figure(std::span<const std::array<double, 3>, 24> joints, int columns, int rows);

}  // namespace booth::daemon
