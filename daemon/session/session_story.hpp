// What happened on the way through a session, for its session.json: from the press that led to it to its end.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "daemon/record/session_info.hpp"

namespace booth::daemon {

/// Bounded: the beginning is kept whole, and the end; what is left out lies between. Not thread-safe.
class SessionStory {
 public:
  static constexpr std::size_t kFirst = 128, kLast = 128;  ///< events kept of each end

  /// Forgets what there was; a trigger while nothing runs begins a new story.
  void begin();
  void note(SessionHappening happening);
  std::vector<SessionHappening> events() const;
  std::uint64_t left_out() const { return left_out_; }

 private:
  std::vector<SessionHappening> first_;
  std::deque<SessionHappening> last_;
  std::uint64_t left_out_ = 0;
};

}  // namespace booth::daemon
