// What somebody at a terminal sees while a verb works; piped, there is nothing but the result.
#pragma once

#include <string>

namespace booth::daemon {

/// "reading ...": for one step of which nobody knows how long it takes.
void say_step(const std::string& what);

/// One line on stderr that is written over and over and is gone in the end. Not thread-safe.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  /// Nothing happens for the text that stands there already.
  void show(const std::string& text);
  /// Makes room for other lines.
  void clear();

 private:
  const bool terminal_;
  std::string shown_;
};

}  // namespace booth::daemon
