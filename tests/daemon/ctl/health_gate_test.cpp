// What the gate lets pass: statuses of a booth that starts, loses a camera, raises an alarm, is started again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/ctl/health_gate.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;

StatusJson booth(std::initializer_list<std::pair<const char*, int>> cameras, const std::string& alarm = "") {
  StatusJson j{{"ok", true}, {"state", "idle"}, {"alarm", alarm}, {"cameras_minimum", 2}, {"cameras", StatusJson::array()}};
  int n = 0;
  for (const auto& [state, delivered] : cameras) j["cameras"].push_back({{"name", "c" + std::to_string(++n)}, {"state", state}, {"delivered", delivered}});
  return j;
}

TEST(HealthGate, WaitsForFramesOfEveryCameraInService) {
  HealthGate gate({.frames = 10});
  EXPECT_FALSE(gate.look(booth({{"running", 1000}, {"running", 2000}})).healthy) << "what came before does not count";
  const auto verdict = gate.look(booth({{"running", 1010}, {"running", 2009}}));
  EXPECT_FALSE(verdict.healthy);
  EXPECT_EQ(verdict.sentence, "camera c2 has delivered 9 of 10 frames");
  EXPECT_TRUE(gate.look(booth({{"running", 1010}, {"running", 2010}})).healthy);
}

TEST(HealthGate, FramesOfAnotherLifeDoNotCount) {
  HealthGate gate({.frames = 10});
  gate.look(booth({{"running", 0}, {"running", 0}}));
  gate.forget();
  EXPECT_FALSE(gate.look(booth({{"running", 50}, {"running", 50}})).healthy);
  EXPECT_FALSE(gate.look(booth({{"running", 3}, {"running", 3}})).healthy) << "counted from zero again";
  EXPECT_TRUE(gate.look(booth({{"running", 13}, {"running", 13}})).healthy);
}

TEST(HealthGate, ACameraThatIsMissing) {
  HealthGate lenient({}), strict({.frames = 0, .every_camera = true});
  const StatusJson one_lost = booth({{"running", 5}, {"lost", 5}, {"running", 5}});
  EXPECT_TRUE(lenient.look(one_lost).healthy);
  EXPECT_THAT(lenient.look(one_lost).sentence, HasSubstr("camera c2 is lost"));
  EXPECT_FALSE(strict.look(one_lost).healthy);
  EXPECT_THAT(strict.look(one_lost).sentence, HasSubstr("2 of 3 cameras deliver, 3 are needed; camera c2 is lost"));
  EXPECT_FALSE(lenient.look(booth({{"running", 5}, {"lost", 5}, {"starting", 0}})).healthy);
}

TEST(HealthGate, AnAlarmIsUnhealthy) {
  const auto verdict = HealthGate({}).look(booth({{"running", 5}, {"running", 5}}, "the disk is full"));
  EXPECT_FALSE(verdict.healthy);
  EXPECT_THAT(verdict.sentence, HasSubstr("the disk is full"));
}

TEST(HealthGate, AnUpdateIsJudgedByTheNewProcess) {
  HealthGate gate({.frames = 0, .every_camera = false, .software = "boothd 2.0.0"});
  StatusJson status = booth({{"running", 5}, {"running", 5}});
  EXPECT_THAT(gate.look(status).sentence, HasSubstr("does not say its version"));
  status["software"] = "boothd 1.9.0";
  EXPECT_FALSE(gate.look(status).healthy);
  EXPECT_EQ(gate.look(status).sentence, "boothd 1.9.0 answers where boothd 2.0.0 is installed; systemctl restart boothd");
  status["software"] = "boothd 2.0.0";
  EXPECT_TRUE(gate.look(status).healthy);
  EXPECT_TRUE(HealthGate({}).look(booth({{"running", 5}, {"running", 5}})).healthy) << "nobody asked for a version";
}

TEST(HealthGate, ABoothWithoutCamerasOwesNoFrames) { EXPECT_TRUE(HealthGate({.frames = 10}).look(booth({})).healthy); }

TEST(HealthGate, WhatIsNoStatusIsUnhealthy) {
  for (const char* text : {"null", "[]", "{}", "3", R"({"ok":true})", R"({"ok":false,"state":"idle"})", R"({"ok":true,"state":7})"})
    EXPECT_FALSE(HealthGate({}).look(StatusJson::parse(text)).healthy) << text;
  EXPECT_TRUE(HealthGate({}).look(StatusJson::parse(R"({"ok":true,"state":"idle","cameras":"none","alarm":5})")).healthy);
  EXPECT_FALSE(HealthGate({}).look(StatusJson::parse(R"({"ok":true,"state":"idle","cameras":[1,null,[]]})")).healthy);
}

}  // namespace
}  // namespace booth::daemon
