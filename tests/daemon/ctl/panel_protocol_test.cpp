// The control socket's two requests about a simulated panel: what they do, what they refuse, and that they leave all others alone.
#include "daemon/ctl/panel_protocol.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::eventually;

struct PanelProtocolTest : ::testing::Test {
  void open() {
    device = open_panel(config, clock);
    ASSERT_TRUE(device.panel);
    ASSERT_TRUE(device.visitor);
    ASSERT_TRUE(eventually([&] {
      device.panel->play(hal::Sound::countdown);
      return device.panel->progress() > 2;
    }));
  }
  json ask(const std::string& line) {
    const auto answer = answer_panel_request(line, device.visitor.get());
    return answer ? json::parse(*answer) : json();
  }
  drivers::SystemClock clock;
  Config config;
  PanelDevice device;
};

TEST_F(PanelProtocolTest, PressesAndTellsOfTheLamps) {
  config.gpio.chip = "simulated";
  open();
  EXPECT_EQ(ask(R"({"request":"press","button":"start","down":true})")["ok"], true);
  const auto event = device.panel->wait(20s);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->kind, hal::TriggerKind::toggle) << "one button toggles";
  device.panel->show({hal::LightPattern::idle_steady});
  ASSERT_TRUE(eventually([&] { return ask(R"({"request":"lamp","lamp":"light"})")["lit"] == true; }));
  const json lamp = ask(R"({"request":"lamp","lamp":"light"})");
  ASSERT_EQ(lamp["changes"].size(), 1u);
  EXPECT_EQ(lamp["changes"][0][1], true);
}

TEST_F(PanelProtocolTest, TheSimulatedEmergencyStopIsAtRestUntilPressed) {
  config.gpio.chip = "simulated";
  open();
  EXPECT_FALSE(device.panel->wait(100ms));
  ask(R"({"request":"press","button":"emergency_stop","down":true})");
  const auto event = device.panel->wait(20s);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->kind, hal::TriggerKind::emergency_pressed);
}

TEST_F(PanelProtocolTest, RefusesWhatMakesNoSense) {
  config.gpio.chip = "simulated";
  config.gpio.start = "go";
  open();
  for (const char* line : {R"({"request":"press"})", R"({"request":"press","button":"start"})", R"({"request":"press","button":"start","down":1})",
                           R"({"request":"press","button":"stop","down":true})", R"({"request":"press","button":"go","down":true})",
                           R"({"request":"press","button":"light","down":true})", R"({"request":"press","button":7,"down":true})", R"({"request":"lamp"})",
                           R"({"request":"lamp","lamp":"start"})"}) {
    const json answer = ask(line);
    EXPECT_EQ(answer["ok"], false) << line;
    EXPECT_FALSE(answer["error"].get<std::string>().empty());
  }
  EXPECT_EQ(ask(R"({"request":"lamp","lamp":"light"})")["lit"], false) << "a panel without a light has a dark one";
  for (const char* line : {"", "{", "[]", "7", R"({"request":"status"})", R"({"request":7})", "\xff"}) EXPECT_TRUE(ask(line).is_null()) << line;
}

TEST_F(PanelProtocolTest, IsNotThereWithoutASimulatedPanel) {
  EXPECT_FALSE(open_panel(config, clock).panel) << "gpio.chip is empty";
  EXPECT_THAT(ask(R"({"request":"press","button":"start","down":true})")["error"], HasSubstr("not a simulated one"));
}

TEST_F(PanelProtocolTest, KeysThatContradictEachOtherAreRefused) {
  const auto refusal = [&] {
    const auto problems = panel_problems(config);
    if (problems.empty()) return std::string("accepted");
    EXPECT_THROW((void)open_panel(config, clock), std::invalid_argument);
    return problems.front().sentence;
  };
  EXPECT_EQ(refusal(), "accepted");
  config.gpio.start = "3";
  EXPECT_THAT(refusal(), HasSubstr("gpio.start is set and gpio.chip is not"));
  config.gpio.chip = "chip";
  EXPECT_EQ(refusal(), "accepted");
  config.gpio.light = "3";
  EXPECT_THAT(refusal(), HasSubstr("gpio.start and gpio.light are the same line"));
  config.gpio.light = config.gpio.start = "";
  EXPECT_THAT(refusal(), HasSubstr("no line is"));
  config.gpio.stop = "4";
  EXPECT_THAT(refusal(), HasSubstr("gpio.stop is set and gpio.start is not"));
  config.gpio.light = "4";
  EXPECT_EQ(panel_problems(config).size(), 2u) << "all of them, for whoever only looks";
}

}  // namespace
}  // namespace booth::daemon
