// A list that is open in the middle.
#include "daemon/session/session_story.hpp"

namespace booth::daemon {

void SessionStory::begin() {
  first_.clear();
  last_.clear();
  left_out_ = 0;
}

void SessionStory::note(SessionHappening happening) {
  if (first_.size() < kFirst) {
    first_.push_back(std::move(happening));
    return;
  }
  last_.push_back(std::move(happening));
  if (last_.size() <= kLast) return;
  last_.pop_front();
  ++left_out_;
}

std::vector<SessionHappening> SessionStory::events() const {
  std::vector<SessionHappening> out = first_;
  out.insert(out.end(), last_.begin(), last_.end());
  return out;
}

}  // namespace booth::daemon
