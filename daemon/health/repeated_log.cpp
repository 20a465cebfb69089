// Sentences are compared without their numbers.
#include "daemon/health/repeated_log.hpp"

#include <algorithm>

namespace booth::daemon {
namespace {

/// Runs of digits become one '#', but only within words that are nothing but a number: names such as "2-1" and serials stay what they are.
std::string cause_of(const std::string& sentence) {
  std::string out, word;
  const auto end_word = [&] {
    const bool number = !word.empty() && (word.starts_with("0x") || word.size() <= 6) && word.find_first_not_of("0123456789abcdefx.,()") == std::string::npos &&
                        word.find_first_of("0123456789") != std::string::npos;
    out += number ? "#" : word;
    word.clear();
  };
  for (const char c : sentence) {
    if (c != ' ') {
      word += c;
      continue;
    }
    end_word();
    out += c;
  }
  end_word();
  return out;
}

}  // namespace

RepeatedLog::Cause& RepeatedLog::find(const std::string& key) {
  const auto known = std::find_if(causes_.begin(), causes_.end(), [&](const Cause& c) { return c.key == key; });
  if (known != causes_.end()) return *known;
  Cause& oldest = *std::min_element(causes_.begin(), causes_.end(), [](const Cause& a, const Cause& b) { return a.seen < b.seen; });
  tell_one(oldest);
  oldest = Cause{};
  return oldest;
}

void RepeatedLog::tell_one(Cause& cause) {
  if (cause.again > 0) write_(cause.level, cause.sentence + " (again, " + std::to_string(cause.again) + (cause.again == 1 ? " time)" : " times)"));
  cause.again = 0;
}

bool RepeatedLog::say(LogLevel level, const std::string& sentence, hal::MonotonicTime now) {
  const std::string key = cause_of(sentence);
  const std::lock_guard lock(mutex_);
  Cause& cause = find(key);
  const bool known = !cause.key.empty();
  cause.seen = now;
  if (known && now - cause.written < window_) {
    ++cause.again;
    cause.sentence = sentence;
    return false;
  }
  tell_one(cause);
  cause = {.key = key, .sentence = sentence, .level = level, .written = now, .seen = now, .again = 0};
  write_(level, sentence);
  return true;
}

void RepeatedLog::tell(hal::MonotonicTime now, bool everything) {
  const std::lock_guard lock(mutex_);
  for (Cause& cause : causes_) {
    if (cause.again == 0 || (!everything && now - cause.written < window_)) continue;
    tell_one(cause);
    cause.written = now;
  }
}

}  // namespace booth::daemon
