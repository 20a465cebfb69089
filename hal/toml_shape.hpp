// What a text must look like before toml++ 3.3 may see it: on texts that are no TOML that library reaches code which it has marked as unreachable.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace booth::hal {

/// Where a text stops being TOML; both numbers from 1, columns counted in characters.
struct TomlFault {
  std::size_t line = 1, column = 1;
  std::string what;  ///< what is wrong and what to do, without the place
};

/// Walks along keys, brackets, strings and comments of a text (TOML 1.0) and says where they do not fit together. What stands between them, numbers, dates,
/// escapes and keys that are given twice, is left to the library, which answers those with a sentence. Three faults of toml++ 3.3 are kept from it so:
/// - a character beyond ASCII where only blanks, keys and numbers may stand, and behind the backslash that ends a line of a long string. (A valid text may have
/// the
///   latter; it is refused all the same, with how to write it.)
/// - a table's header without a key, such as `[#t]`,
/// - a value that is none, such as `[}`.
class TomlShape {
 public:
  explicit TomlShape(std::string_view text) : text_(text), at_(text.starts_with("\xEF\xBB\xBF") ? 3 : 0) {}

  std::optional<TomlFault> fault() {
    while (!end()) statement();
    return std::move(fault_);
  }

 private:
  static constexpr int kDeepest = 100;  ///< values within values; this walk and the library's parser go down by calls

  bool end() const { return at_ >= text_.size(); }
  char peek(std::size_t ahead = 0) const { return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0'; }
  bool beyond_ascii() const { return static_cast<unsigned char>(peek()) >= 0x80; }
  static bool digit(char c) { return c >= '0' && c <= '9'; }
  static bool key_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || digit(c) || c == '_' || c == '-'; }
  static bool value_letter(char c) { return key_letter(c) || c == '+' || c == '.' || c == ':'; }

  /// Nothing is looked at any more.
  void fail(std::string what) {
    if (fault_) return;
    if (!end() && beyond_ascii())
      what = "a character beyond ASCII (perhaps a blank that is none) may stand in quotes and comments only; quote it or take it out";
    if (end()) what += ", and the text ends";
    const std::string_view before = text_.substr(0, std::min(at_, text_.size()));
    const auto line_begin = before.rfind('\n') == std::string_view::npos ? 0 : before.rfind('\n') + 1;
    const auto begins_character = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; };
    fault_ = TomlFault{
        .line = 1 + static_cast<std::size_t>(std::count(before.begin(), before.end(), '\n')),
        .column = 1 + static_cast<std::size_t>(std::count_if(before.begin() + static_cast<std::ptrdiff_t>(line_begin), before.end(), begins_character)),
        .what = std::move(what)};
    at_ = text_.size();
  }

  void expect(char c) {
    if (peek() == c)
      ++at_;
    else
      fail(std::string("'") + c + "' is expected");
  }

  void blanks() {
    while (peek() == ' ' || peek() == '\t') ++at_;
  }

  bool newline() {
    const std::size_t length = peek() == '\n' ? 1 : peek() == '\r' && peek(1) == '\n' ? 2 : 0;
    at_ += length;
    return length > 0;
  }

  bool comment() {
    if (peek() != '#') return false;
    at_ = std::min(text_.find('\n', at_), text_.size());
    return true;
  }

  void statement() {
    blanks();
    if (end() || newline() || comment()) return;
    if (peek() == '[')
      header();
    else
      pair();
    blanks();
    if (!end() && !comment() && !newline()) fail("the end of the line, or a comment, is expected");
  }

  void header() {
    ++at_;
    const bool list = peek() == '[';
    at_ += list;
    blanks();
    key();
    expect(']');
    if (list) expect(']');
  }

  void pair() {
    key();
    expect('=');
    blanks();
    value();
  }

  /// A dotted key and the blanks behind it.
  void key() {
    while (!end()) {
      if (peek() == '"' || peek() == '\'') {
        if (peek(1) == peek() && peek(2) == peek()) return fail("a key must stand on one line, in single quotes");
        short_string();
      } else if (key_letter(peek())) {
        while (key_letter(peek())) ++at_;
      } else {
        return fail("a key is expected: letters from a to z, digits, '_' and '-', or quotes");
      }
      blanks();
      if (peek() != '.') return;
      ++at_;
      blanks();
    }
    fail("a key is expected");
  }

  void value() {
    const char c = peek();
    if (c == '[' || c == '{') {
      if (++depth_ > kDeepest) return fail("values are nested too deeply; at most " + std::to_string(kDeepest) + " may stand in each other");
      c == '[' ? array() : inline_table();
      --depth_;
    } else if (c == '"' || c == '\'') {
      peek(1) == c&& peek(2) == c ? long_string() : short_string();
    } else {
      word();
    }
  }

  /// A number, a date, true or false; what it is says the library.
  void word() {
    const std::size_t begin = at_;
    while (value_letter(peek())) ++at_;
    if (at_ == begin) return fail("a value is expected");
    // Between date and time a blank may stand.
    if (at_ - begin != 10 || text_[begin + 4] != '-' || text_[begin + 7] != '-' || peek() != ' ' || !digit(peek(1))) return;
    ++at_;
    while (value_letter(peek())) ++at_;
  }

  void array() {
    ++at_;
    while (!end()) {
      gap();
      if (peek() == ']') break;
      value();
      gap();
      if (peek() != ',') break;
      ++at_;
    }
    expect(']');
  }

  /// What may stand between the values of an array.
  void gap() {
    do blanks();
    while (!end() && (newline() || comment()));
  }

  void inline_table() {
    ++at_;
    blanks();
    if (peek() == '}') {
      ++at_;
      return;
    }
    while (!end()) {
      pair();
      blanks();
      if (peek() != ',') break;
      ++at_;
      blanks();
    }
    expect('}');
  }

  void short_string() {
    const char quote = peek();
    for (++at_; !end() && peek() != quote && peek() != '\n'; ++at_)
      if (quote == '"' && peek() == '\\' && peek(1) != '\n') ++at_;
    if (end() || peek() != quote) return fail("a string has no end; quotes are closed on the same line");
    ++at_;
  }

  void long_string() {
    const char quote = peek();
    at_ += 3;
    while (!end()) {
      if (peek() == quote) {
        std::size_t run = 1;
        while (run < 5 && peek(run) == quote) ++run;
        at_ += run;
        if (run >= 3) return;  // one or two that belong to the text may stand before the three
      } else if (quote == '"' && peek() == '\\') {
        escape();
      } else {
        ++at_;
      }
    }
    fail("a string has no end; three quotes close it");
  }

  /// In a long string.
  void escape() {
    ++at_;
    if (peek() == ' ' || peek() == '\t' || peek() == '\r' || peek() == '\n') {
      do blanks();
      while (!end() && newline());
    } else if (!beyond_ascii()) {
      ++at_;
      return;
    }
    if (!end() && beyond_ascii()) fail_here("behind a backslash a character beyond ASCII is not read; write it as \\u and its number, or the text on one line");
  }

  /// The same for a place at which characters beyond ASCII are allowed otherwise.
  void fail_here(std::string what) {
    fail({});
    fault_->what = std::move(what);
  }

  const std::string_view text_;
  std::size_t at_;
  int depth_ = 0;
  std::optional<TomlFault> fault_;
};

/// The first place at which `text` is not TOML by its shape, or that must not reach the library. Bytes need not be UTF-8. Thread-safe.
inline std::optional<TomlFault> find_toml_fault(std::string_view text) { return TomlShape(text).fault(); }

}  // namespace booth::hal
