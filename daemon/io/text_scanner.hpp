// Lines and words of a text file, with the line number that every error names.
#pragma once

#include <charconv>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>

namespace booth::daemon {

/// Walks over text that outlives it. A line ends with \n, \r\n or the end of the text.
class TextScanner {
 public:
  explicit TextScanner(std::string_view text) : rest_(text) {}

  /// False at the end.
  bool next_line() {
    if (rest_.empty()) return false;
    const std::size_t end = rest_.find('\n');
    line_ = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    if (!line_.empty() && line_.back() == '\r') line_.remove_suffix(1);
    ++number_;
    return true;
  }

  /// The next word of the current line, empty when there is none. Commas and semicolons separate like blanks.
  std::string_view word() {
    const std::size_t start = line_.find_first_not_of(" \t,;");
    if (start == std::string_view::npos) {
      line_ = {};
      return {};
    }
    line_.remove_prefix(start);
    const std::size_t end = line_.find_first_of(" \t,;");
    const std::string_view w = line_.substr(0, end);
    line_.remove_prefix(w.size());
    return w;
  }

  std::string_view line() const { return line_; }  ///< what is left of the current line
  std::string_view rest() const { return rest_; }  ///< everything after the current line
  std::int64_t line_number() const { return number_; }
  std::string where() const { return "line " + std::to_string(number_); }

 private:
  std::string_view rest_, line_;
  std::int64_t number_ = 0;
};

/// The whole word as a number ("nan" and "inf" included); false otherwise. Independent of the locale.
template <typename T>
bool parse_number(std::string_view word, T& out) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), out);
  // A number that the type cannot hold is still a number: nearly nothing, or beyond all bounds.
  if constexpr (std::is_floating_point_v<T>) {
    if (error == std::errc::result_out_of_range && end == word.data() + word.size()) {
      const bool tiny = word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos;
      out = tiny ? T(0) : std::numeric_limits<T>::infinity();
      return true;
    }
  }
  return error == std::errc{} && end == word.data() + word.size() && !word.empty();
}

}  // namespace booth::daemon
