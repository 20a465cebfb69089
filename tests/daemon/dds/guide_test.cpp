// The subscriber of docs/guide/subscribe.md: the page shows what is compiled here, and what is compiled hears a booth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

TEST(DdsGuide, ThePageShowsWhatIsCompiled) {
  const std::string page = read_text(BOOTH_SOURCE_DIR "/docs/guide/subscribe.md"), program = read_text(BOOTH_SOURCE_DIR "/tests/daemon/dds/subscriber.cpp");
  EXPECT_NE(page.find("```cpp\n" + program + "```\n"), std::string::npos) << "copy tests/daemon/dds/subscriber.cpp into the page";
}

TEST(DdsGuide, TheSubscriberHearsABooth) {
  TemporaryFolder folder;
  const std::string domain = std::to_string(test_domain());
  // As a user would say where to listen: by the library's own variable.
  std::string uri = daemon::dds_configuration(loopback("*"));
  uri.replace(uri.find("<Domain Id=\"any\">"), 17, "<Domain Id=\"" + domain + "\">");
  ::setenv("CYCLONEDDS_URI", uri.c_str(), 1);
  Program subscriber("booth-guide-subscriber", {"guide0"}, folder.path / "heard");
  ::unsetenv("CYCLONEDDS_URI");
  {
    Program booth("booth-simulated", {domain, "guide", "1"}, folder.path / "booth");
    EXPECT_TRUE(eventually([&] { return subscriber.output().find("guide0: head at ") != std::string::npos; }, std::chrono::seconds(60)))
        << subscriber.output() << booth.output();
  }
  EXPECT_TRUE(eventually([&] { return subscriber.output().find("guide0 is gone") != std::string::npos; }, std::chrono::seconds(60))) << subscriber.output();
}

}  // namespace
}  // namespace booth::tests
