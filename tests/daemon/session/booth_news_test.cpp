// What changes in the booth is said once, with the right kind, and again only when it is otherwise.
#include "daemon/session/booth_news.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/clock/manual_clock.hpp"

namespace booth::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

CameraStatus running(const std::string& name) {
  CameraStatus out;
  out.name = name, out.state = CameraState::running;
  return out;
}

struct BoothNewsTest : ::testing::Test {
  /// What was said since the last call, "kind source: text".
  std::vector<std::string> heard() { return std::exchange(events, {}); }

  drivers::ManualClock clock;
  std::vector<std::string> events;
  BoothNews news{clock,
                 [this](const std::string& kind, const std::string& source, const std::string& text) { events.push_back(kind + " " + source + ": " + text); }};
  std::vector<CameraStatus> cameras{running("front-left"), running("front-right")};
};

TEST_F(BoothNewsTest, ACameraIsLostOnceAndBackOnce) {
  news.cameras(cameras);
  EXPECT_THAT(heard(), ElementsAre("state cameras: camera front-left is running", "state cameras: camera front-right is running"));
  cameras[1].state = CameraState::lost, cameras[1].problem = "no frame for 1.5 s";
  news.cameras(cameras);
  news.cameras(cameras);
  EXPECT_THAT(heard(), ElementsAre("fault cameras: camera front-right is lost: no frame for 1.5 s"));
  cameras[1].problem = "the cable is out";  // a line of the log, and no new event
  news.cameras(cameras);
  EXPECT_THAT(heard(), IsEmpty());
  cameras[1].state = CameraState::running, cameras[1].problem.clear();
  news.cameras(cameras);
  EXPECT_THAT(heard(), ElementsAre("state cameras: camera front-right is running"));
}

TEST_F(BoothNewsTest, WorkThatChangesHandsIsSaidAndVainTriesAreNot) {
  BackendStatus backend;
  news.backend(backend);
  EXPECT_THAT(heard(), IsEmpty()) << "a booth without a device";
  backend = {.name = "cpu", .problem = "no answer within 250 ms", .losses = 1, .changes = 1};
  news.backend(backend);
  EXPECT_THAT(heard(), ElementsAre("fault fit: the fit is computed by cpu: no answer within 250 ms"));
  backend.problem = "the device is not there", backend.losses = 2;
  news.backend(backend);
  EXPECT_THAT(heard(), IsEmpty());
  backend = {.name = "device cuda H100", .problem = {}, .losses = 2, .changes = 2};
  news.backend(backend);
  EXPECT_THAT(heard(), ElementsAre("state fit: the fit is computed by device cuda H100"));
  news.cameras(cameras);
  heard();
  cameras[0].decoding = {.name = "cpu avx2", .problem = "out of memory", .losses = 1, .changes = 1};
  news.cameras(cameras);
  EXPECT_THAT(heard(), ElementsAre("fault cameras: depth of camera front-left is decoded by cpu avx2: out of memory"));
}

TEST_F(BoothNewsTest, TheSentenceOfAMovedCameraStandsWhileItsFiguresChange) {
  using Verdict = CameraDriftStatus::Verdict;
  std::vector<CameraDriftStatus> drift(2);
  drift[0].verdict = drift[1].verdict = Verdict::stands;
  EXPECT_FALSE(news.drift(drift, cameras));
  drift[1].verdict = Verdict::moved, drift[1].displacement = 0.03, drift[1].deviation = 0.001, drift[1].shift = 0.03;
  const auto problem = news.drift(drift, cameras);
  ASSERT_TRUE(problem);
  EXPECT_THAT(*problem, HasSubstr("front-right"));
  EXPECT_THAT(heard(), ElementsAre(AllOf(StartsWith("fault cameras: "), HasSubstr("front-right"))));
  drift[1].displacement = 0.04;
  EXPECT_FALSE(news.drift(drift, cameras));
  EXPECT_THAT(heard(), IsEmpty());
  drift[1].verdict = Verdict::stands;
  EXPECT_EQ(news.drift(drift, cameras), "");
  EXPECT_THAT(heard(), ElementsAre(StartsWith("state cameras: ")));
}

TEST_F(BoothNewsTest, ThePanelAndTheCredentialsComplainOnceAndRecover) {
  news.panel({"the light cannot be set"});
  news.panel({"the light cannot be set"});
  EXPECT_THAT(heard(), ElementsAre("fault gpio: the light cannot be set"));
  news.panel({});
  news.panel({});
  EXPECT_THAT(heard(), ElementsAre("state gpio: buttons and light work again"));
  news.credentials("");
  EXPECT_THAT(heard(), IsEmpty());
  news.credentials("end in 9 days");
  news.credentials("end in 9 days");
  news.credentials("end in 8 days");
  news.credentials("");
  EXPECT_THAT(heard(), ElementsAre("fault dds: end in 9 days", "fault dds: end in 8 days", "state dds: the credentials serve for long enough again"));
}

}  // namespace
}  // namespace booth::daemon
