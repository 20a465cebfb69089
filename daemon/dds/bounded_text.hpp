// Texts in the bounded strings of an IDL type: cut where they are too long, and never inside a character.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>

namespace booth::daemon {

/// How much of a text to keep where it is cut at `most` bytes: no half of a UTF-8 character, which strict readers refuse together with its sample. Of what is
/// no UTF-8 all of them.
inline std::size_t cut_length(const std::string& text, std::size_t most) {
  if (text.size() <= most) return text.size();
  for (std::size_t back = 0; back < 4 && back <= most; ++back)
    if ((static_cast<unsigned char>(text[most - back]) & 0xC0) != 0x80) return most - back;  // a character begins here
  return most;
}

/// Copies into a bounded IDL string, cutting what is too long; what is left of it becomes zero.
template <std::size_t N>
void set_text(char (&to)[N], const std::string& from) {
  const std::size_t n = cut_length(from, N - 1);
  std::memcpy(to, from.data(), n);
  std::memset(to + n, 0, N - n);
}

}  // namespace booth::daemon
