// The story of a session keeps both ends and says how much is left out between them.
#include "daemon/session/session_story.hpp"

#include <gtest/gtest.h>

namespace booth::daemon {
namespace {

TEST(SessionStory, KeepsItsBeginningAndItsEnd) {
  SessionStory story;
  for (int i = 0; i < 1000; ++i) story.note({i, "state", "test", "x"});
  const auto events = story.events();
  ASSERT_EQ(events.size(), SessionStory::kFirst + SessionStory::kLast);
  EXPECT_EQ(events.front().utc_ns, 0);
  EXPECT_EQ(events[SessionStory::kFirst - 1].utc_ns, 127);
  EXPECT_EQ(events[SessionStory::kFirst].utc_ns, 872);
  EXPECT_EQ(events.back().utc_ns, 999);
  EXPECT_EQ(story.left_out(), 1000 - events.size());
}

TEST(SessionStory, BeginsAnew) {
  SessionStory story;
  for (int i = 0; i < 1000; ++i) story.note({i, "state", "test", "x"});
  story.begin();
  story.note({7, "trigger", "gpio", "toggle"});
  ASSERT_EQ(story.events().size(), 1u);
  EXPECT_EQ(story.events()[0].text, "toggle");
  EXPECT_EQ(story.left_out(), 0u);
}

}  // namespace
}  // namespace booth::daemon
