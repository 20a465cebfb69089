// boothctl security, and boothd with dds.security = "on", as programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "daemon/ctl/control_client.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/security/test_fleet.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct SecurityProgram : ::testing::Test {
  TestFleet fleet;
  std::string output, socket = (fleet.folder.path / "c.sock").string();
  const std::string self_issued = (fleet.folder.path / "security").string();

  int run(const std::string& name, const std::vector<std::string>& arguments) {
    Program program(name, arguments, fleet.folder.path / "output");
    const int status = program.wait(120s);
    output = program.output();
    return status;
  }
  static std::vector<std::string> set(std::vector<std::string> before, const std::vector<std::string>& assignments) {
    for (const auto& one : assignments) {
      before.push_back("--set");
      before.push_back(one);
    }
    return before;
  }
  std::vector<std::string> network() const {
    return {"dds.interface=lo", "dds.multicast=false", "dds.domain=" + std::to_string(test_domain()), "dds.security=on", "dds.self_issued=" + self_issued,
            "booth.id=lobby"};
  }
  std::vector<std::string> boothd(const std::vector<std::string>& more) const {
    auto all = network();
    all.insert(all.end(), {"control.socket=" + socket, "session.directory=" + (fleet.folder.path / "sessions").string(), "cameras.synthetic.motion=a-pose"});
    all.insert(all.end(), more.begin(), more.end());
    return set({}, all);
  }
  json status() const {
    daemon::ControlClient client(socket);
    return json::parse(client.ask(R"({"request":"status"})"));
  }
  bool is_ready() const {
    return eventually(
        [&] {
          try {
            return status()["state"] == "idle";
          } catch (const std::exception&) {
            return false;
          }
        },
        90s);
  }
};

TEST_F(SecurityProgram, MakesIssuesAndShows) {
  const std::string place = (fleet.folder.path / "made").string();
  ASSERT_EQ(run("boothctl", {"security", "init", place, "--fleet", "museum"}), 0) << output;
  EXPECT_EQ(run("boothctl", {"security", "init", place}), 1);
  EXPECT_THAT(output, HasSubstr("never overwritten"));
  EXPECT_EQ(run("boothctl", {"security", "issue", place, "booth", "lobby", "--json"}), 0);
  EXPECT_EQ(json::parse(output)["folder"], place + "/issued/booth.lobby");
  EXPECT_EQ(run("boothctl", {"security", "issue", place, "viewer", "wall"}), 1);
  EXPECT_THAT(output, HasSubstr("needs the booths"));
  EXPECT_EQ(run("boothctl", {"security", "issue", place, "viewer", "wall", "--booths", "lobby,hall"}), 0);
  EXPECT_EQ(run("boothctl", {"security", "issue", place, "emperor", "me"}), 64);
  EXPECT_EQ(run("boothctl", {"security", "show", place}), 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("museum identities"), HasSubstr("booth.lobby"), HasSubstr("viewer.wall"), HasSubstr("of lobby, hall")));
  EXPECT_EQ(run("boothctl", {"security", "issue", place, "console", "desk", "--booths", "*", "--days", "10"}), 0);
  EXPECT_EQ(run("boothctl", {"security", "show", place, "--json"}), 1) << "something expires soon";
  const json shown = json::parse(output.substr(0, output.rfind('}') + 1));
  EXPECT_FALSE(shown["ok"]);
  ASSERT_EQ(shown["participants"].size(), 3u);
  const std::string serial = shown["participants"][1]["serial"];
  EXPECT_THAT(shown["participants"][1]["problem"], HasSubstr("expires on"));
  EXPECT_EQ(run("boothctl", {"security", "revoke", place, serial, "--json"}), 0) << output;
  EXPECT_EQ(json::parse(output)["revoked"], json::array({serial}));
  EXPECT_EQ(run("boothctl", {"security", "revoke", place, "xyz"}), 64);
  EXPECT_EQ(run("boothctl", {"security", "show", fleet.folder.path.string()}), 1);
  EXPECT_THAT(output, HasSubstr("holds neither credentials"));
}

TEST_F(SecurityProgram, BoothdDoesNotStartWithoutItsCredentials) {
  EXPECT_EQ(run("boothd", boothd({"dds.credentials=" + (fleet.folder.path / "nowhere").string()})), 78);
  EXPECT_THAT(output, HasSubstr("nowhere/identity_ca.cert.pem"));
  EXPECT_EQ(run("boothd", boothd({"dds.credentials=" + fleet.booth("hall")})), 78);
  EXPECT_THAT(output, HasSubstr("booth.lobby is needed here"));
  Craft expired = fleet.honest();
  expired.name = "booth.lobby";
  expired.rules = daemon::rules_for(daemon::Role::booth, {"lobby"});
  expired.certificate.until = fleet.now - 60;
  EXPECT_EQ(run("boothd", boothd({"dds.credentials=" + fleet.write(expired, "expired")})), 69) << "is tried again: the clock may have leapt ahead";
  EXPECT_THAT(output, AllOf(HasSubstr("expired/cert.pem"), HasSubstr("expired at"), HasSubstr("boothctl security issue")));
  Craft future = expired;
  future.certificate = {fleet.now + 3600, fleet.now + 7200};
  EXPECT_EQ(run("boothd", boothd({"dds.credentials=" + fleet.write(future, "future")})), 69) << "is tried again: the clock may be set later";
  EXPECT_THAT(output, HasSubstr("set the clock"));
}

TEST_F(SecurityProgram, ASelfIssuedBoothIsHeardByWhoHasItsCredentials) {
  auto check = boothd({});
  check.push_back("--check-config");
  EXPECT_EQ(run("boothd", check), 0) << output;
  EXPECT_FALSE(std::filesystem::exists(self_issued)) << "looking makes nothing";
  Program booth("boothd", boothd({}), fleet.folder.path / "boothd");
  ASSERT_TRUE(is_ready()) << booth.output();
  EXPECT_THAT(status()["dds_security"], HasSubstr("self-issued, booth.lobby, until "));
  EXPECT_EQ(status()["credential_problem"], "");
  EXPECT_EQ(run("boothctl", {"status", "--socket", socket}), 0);
  EXPECT_THAT(output, HasSubstr("security   self-issued, booth.lobby"));
  auto fleet_verb = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"fleet", "--expect", "lobby"};
    words.insert(words.end(), more.begin(), more.end());
    return set(words, network());
  };
  EXPECT_EQ(run("boothctl", fleet_verb({"--seconds", "30"})), 0) << output;
  EXPECT_EQ(run("boothctl", fleet_verb({"--credentials", fleet.viewer("stranger", {"*"}), "--seconds", "4"})), 1) << "another fleet's";
  EXPECT_THAT(output, Not(HasSubstr("boothd 0")));
  EXPECT_EQ(run("boothctl", fleet_verb({"--set", "dds.credentials=/nonexistent"})), 78);
  EXPECT_THAT(output, HasSubstr("/nonexistent/identity_ca.cert.pem"));
  // Commands: the machine's own console may, its own viewer may not, and a plain one is not even heard.
  const auto command = [&](std::vector<std::string> more, const std::string& what) {
    std::vector<std::string> words{"command", "lobby", what, "--seconds"};
    words.insert(words.end(), more.begin(), more.end());
    return run("boothctl", set(words, network()));
  };
  EXPECT_EQ(command({"60"}, "stop"), 1);
  EXPECT_THAT(output, HasSubstr("refuses: no session"));
  EXPECT_EQ(command({"20", "--credentials", self_issued + "/issued/viewer.local"}, "start"), 1);
  EXPECT_THAT(output, HasSubstr("these credentials may not command booth lobby"));
  std::vector<std::string> plain{"command", "lobby", "start", "--seconds", "3"};
  for (const auto& one : network())
    if (!one.starts_with("dds.security")) plain = set(plain, {one});
  EXPECT_EQ(run("boothctl", plain), 1);
  EXPECT_THAT(output, HasSubstr("was not heard"));
  EXPECT_EQ(status()["state"], "idle");
  booth.signal(SIGTERM);
  EXPECT_EQ(booth.wait(), 0) << booth.output();
  EXPECT_EQ(run("boothctl", set({"security", "show"}, network())), 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("booth.lobby"), HasSubstr("console.local"), HasSubstr("viewer.local")));
}

TEST_F(SecurityProgram, AnExpiryIsAnnouncedAndToldToTheFleet) {
  Craft soon = fleet.honest();
  soon.name = "booth.lobby";
  soon.rules = daemon::rules_for(daemon::Role::booth, {"lobby"});
  soon.certificate.until = fleet.now + 5 * daemon::kSecondsOfDay + 3600;
  Program booth("boothd", boothd({"dds.credentials=" + fleet.write(soon, "soon")}), fleet.folder.path / "boothd");
  ASSERT_TRUE(is_ready()) << booth.output();
  ASSERT_TRUE(eventually([&] { return status()["credential_problem"] != ""; }, 30s));
  EXPECT_THAT(status()["alarm"], HasSubstr("certificate booth.lobby expires in 5 days"));
  EXPECT_THAT(booth.output(), HasSubstr("expires in 5 days"));
  // Whoever may hear some booths and asks for all hears those.
  auto words = set({"fleet", "--seconds", "30", "--expect", "lobby", "--json", "--credentials", fleet.viewer("wall", {"lobby", "hall"})}, network());
  EXPECT_EQ(run("boothctl", words), 1) << "unwell: " << output;
  EXPECT_THAT(output, HasSubstr("expires in 5 days"));
  EXPECT_EQ(run("boothctl", set({"watch", "lobby", "--seconds", "3", "--credentials", fleet.viewer("elsewhere", {"hall"})}, network())), 1);
  EXPECT_THAT(output, HasSubstr("these credentials do not permit booth/skeleton"));
}

}  // namespace
}  // namespace booth::tests
