// Who gets what in a secured domain: booths, viewers, consoles and intruders as programs of their own, over the loopback interface.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <list>

#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/security/test_fleet.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr auto kPatience = 60s;
const std::string kChangedClient = BOOTH_BINARY_DIR "/tests/daemon/security/libbooth-lenient-access.so";

struct SecureDomain : ::testing::Test {
  TestFleet fleet;
  std::list<Program> programs;
  const std::string domain = std::to_string(test_domain());

  Program& start(const std::string& action, const std::string& credentials, const std::string& partition = "lobby", std::int64_t clock_back = 0,
                 const std::string& access_plugin = "") {
    std::vector<std::string> arguments{action, domain, credentials, partition, std::to_string(clock_back)};
    if (!access_plugin.empty()) arguments.push_back(access_plugin);
    return programs.emplace_back("booth-secure-peer", arguments, fleet.folder.path / ("program" + std::to_string(programs.size())));
  }
  static bool comes(const Program& program, const std::string& line, std::chrono::seconds limit = kPatience) {
    return eventually([&] { return program.output().find(line + "\n") != std::string::npos; }, limit);
  }
  Program& ready(Program& program) {
    EXPECT_TRUE(comes(program, "ready")) << program.output();
    return program;
  }
  static bool hears_everything(const Program& viewer) {
    return comes(viewer, "heard booth/skeleton") && comes(viewer, "heard booth/status") && comes(viewer, "heard booth/body") &&
           comes(viewer, "heard booth/event");
  }

  /// An honest viewer who comes after the intruder hears everything, and an honest console who comes after it is obeyed: the intruder had as long.
  void honest_clients_are_served() {
    Program& viewer = ready(start("listen", fleet.viewer("honest", {"lobby"})));
    EXPECT_TRUE(hears_everything(viewer)) << viewer.output();
    EXPECT_THAT(viewer.output(), HasSubstr("refused booth/command")) << "a viewer does not even hear commands";
    Program& console = ready(start("command", fleet.console("honest", {"lobby"})));
    EXPECT_TRUE(comes(console, "answered")) << console.output();
    std::this_thread::sleep_for(500ms);  // for whoever is slower than they were
  }
  static std::size_t count(const std::string& text, const std::string& word) {
    std::size_t n = 0;
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
    return n;
  }
};

/// Two intruders with the same credentials, one that listens and one that commands, get nothing from a booth that serves others.
struct Intruders : SecureDomain {
  struct Intruder {
    std::string credentials, partition = "lobby";
    std::int64_t clock_back = 0;
    std::string access_plugin{};
  };

  void get_nothing(const std::vector<Intruder>& intruders) {
    Program& booth = ready(start("booth", fleet.booth("lobby")));
    std::vector<Program*> ears, mouths;
    for (const auto& who : intruders) {
      ears.push_back(&start("listen", who.credentials, who.partition, who.clock_back, who.access_plugin));
      mouths.push_back(&start("command", who.credentials, who.partition, who.clock_back, who.access_plugin));
    }
    for (const auto& all : {ears, mouths})
      for (Program* program : all) ready(*program);
    std::this_thread::sleep_for(1s);
    EXPECT_EQ(count(booth.output(), "obeyed"), 0u) << "before anybody else has said anything";
    honest_clients_are_served();
    for (const Program* ear : ears)
      for (const char* topic : {"skeleton", "status", "body", "event"}) EXPECT_THAT(ear->output(), Not(HasSubstr(std::string("heard booth/") + topic)));
    for (const Program* mouth : mouths) EXPECT_THAT(mouth->output(), Not(HasSubstr("answered")));
    const Program& console = programs.back();
    EXPECT_LE(count(booth.output(), "obeyed"), count(console.output(), "answered") + 1) << "every command that was obeyed was the console's";
  }
};

TEST_F(Intruders, APlainParticipantGetsNothing) { get_nothing({{.credentials = "plain"}}); }

TEST_F(Intruders, AnUnauthenticatedParticipantGetsNothing) {
  // Everything is right but who has signed: authorities of its own, by the same names.
  const TestFleet stranger;
  get_nothing({{.credentials = stranger.console("stranger", {"*"})}});
}

TEST_F(Intruders, ExpiredCredentialsGetNothingWhereTheirOwnersSetTheClockBack) {
  const daemon::Validity past{fleet.now - 15 * daemon::kSecondsOfDay, fleet.now - 5 * daemon::kSecondsOfDay};
  constexpr std::int64_t kBack = 10 * daemon::kSecondsOfDay;
  Craft certificate = fleet.honest();
  certificate.name = "console.certificate";
  certificate.rules = daemon::rules_for(daemon::Role::console, {"lobby"});
  Craft permissions = certificate;
  permissions.name = "console.permissions";
  certificate.certificate = past;
  permissions.document = past;
  get_nothing({{.credentials = fleet.write(certificate, "certificate"), .clock_back = kBack},
               {.credentials = fleet.write(permissions, "permissions"), .clock_back = kBack}});
}

TEST_F(Intruders, PermissionsOfOnesOwnMakingGetNothing) {
  // The identity is the fleet's; whoever has it has written down what it would like to be allowed.
  const TestFleet stranger;
  Craft craft = fleet.honest();
  craft.name = "console.own";
  craft.rules = {{true, {"*"}, {"*"}}, {false, {"*"}, {"*"}}};
  craft.permissions = stranger.permissions();
  get_nothing({{.credentials = fleet.write(craft, "own")}});
}

TEST_F(Intruders, AnotherBoothsConsoleGetsNothingWithAChangedClient) {
  get_nothing({{.credentials = fleet.console("hall", {"hall"}), .access_plugin = kChangedClient}});
}

TEST_F(SecureDomain, TheLibraryItselfRefusesWhatIsNotPermitted) {
  Program& ear = start("listen", fleet.console("hall", {"hall"}));
  ready(ear);
  for (const char* topic : {"skeleton", "status", "body", "event", "command", "reply"})
    EXPECT_THAT(ear.output(), HasSubstr(std::string("refused booth/") + topic));
  Program& all = start("listen", fleet.viewer("lobby", {"lobby"}), "*");
  ready(all);
  EXPECT_THAT(all.output(), HasSubstr("refused booth/skeleton")) << "all booths are more than one";
}

TEST_F(SecureDomain, AViewersCommandIsNotObeyedAlsoWithAChangedClient) {
  Program& booth = ready(start("booth", fleet.booth("lobby")));
  const std::string viewer = fleet.viewer("wall", {"lobby"});
  Program& honest = start("command", viewer);
  EXPECT_TRUE(comes(honest, "refused booth/command"));
  Program& dishonest = ready(start("command", viewer, "lobby", 0, kChangedClient));
  Program& eye = ready(start("listen", viewer));
  EXPECT_TRUE(hears_everything(eye)) << "the same credentials hear: " << eye.output();
  std::this_thread::sleep_for(2s);
  EXPECT_EQ(count(booth.output(), "obeyed"), 0u);
  EXPECT_THAT(dishonest.output(), Not(HasSubstr("answered")));
  // The changed client is no worse than an honest one where its owner may command: what stopped the viewer is the booth.
  Program& console = ready(start("command", fleet.console("desk", {"*"}), "lobby", 0, kChangedClient));
  EXPECT_TRUE(comes(console, "answered")) << console.output();
  EXPECT_GE(count(booth.output(), "obeyed"), 1u);
}

TEST_F(SecureDomain, AViewerOfAllBoothsHearsEachAlsoWithASlowClock) {
  ready(start("booth", fleet.booth("lobby")));
  // What the intruders with the clock set back are compared with: the clock alone keeps nobody out.
  Program& viewer = ready(start("listen", fleet.viewer("all", {"*"}), "*", 10 * daemon::kSecondsOfDay));
  EXPECT_TRUE(hears_everything(viewer)) << viewer.output();
}

TEST_F(SecureDomain, ARevokedViewerGetsNothing) {
  const std::string revoked = fleet.viewer("revoked", {"lobby"});
  daemon::revoke(fleet.path, {daemon::read_credentials(revoked).certificate.serial}, fleet.now);
  ready(start("booth", fleet.booth("lobby")));
  Program& ear = ready(start("listen", revoked));
  honest_clients_are_served();
  EXPECT_THAT(ear.output(), Not(HasSubstr("heard")));
}

TEST_F(SecureDomain, WhoExpiresWhileConnectedHearsNoMoreAndIsHeardNoMore) {
  ready(start("booth", fleet.booth("lobby")));
  Program& lasting = ready(start("listen", fleet.viewer("lasting", {"*"})));
  ASSERT_TRUE(hears_everything(lasting)) << lasting.output();
  const std::string hall_ear = fleet.viewer("hall", {"hall"});
  const auto total = [](const Program& p) { return count(p.output(), "total "); };
  // A busy machine may need longer than the short life to find each other; then it gets another.
  for (const std::int64_t life : {8, 60}) {
    Craft craft = fleet.honest();
    craft.certificate.until = craft.document.until = daemon::utc_seconds() + life;
    Program& viewer = start("listen", fleet.write(craft, "viewer" + std::to_string(life)));
    craft.name = "booth.hall";
    craft.rules = daemon::rules_for(daemon::Role::booth, {"hall"});
    Program& booth = start("booth", fleet.write(craft, "booth" + std::to_string(life)), "hall");
    Program& ear = start("listen", hall_ear, "hall");
    const auto alive = [&] { return total(viewer) > 0 && total(ear) > 0; };
    const bool met = eventually([&] { return alive() || daemon::utc_seconds() >= craft.certificate.until; }, 100s) && alive();
    if (!met && life == 8) continue;
    ASSERT_TRUE(met) << viewer.output() << ear.output();
    ASSERT_TRUE(eventually([&] { return daemon::utc_seconds() > craft.certificate.until; }, 100s));
    std::size_t heard = 0, before = 0;
    EXPECT_TRUE(eventually(
        [&] {
          heard = total(viewer) + total(ear);
          before = total(lasting);
          return eventually([&] { return total(lasting) > before + 2; }, kPatience) && total(viewer) + total(ear) == heard;  // 60 samples, had they come
        },
        kPatience))
        << viewer.output() << ear.output();
    booth.signal(SIGTERM);
    EXPECT_EQ(booth.wait(), 0) << "a booth that has expired runs on, unheard: " << booth.output();
    return;
  }
}

TEST_F(SecureDomain, IdentitiesRotateWhileTheOldOnesServe) {
  const std::string booth_place = fleet.booth("lobby"), viewer_place = fleet.viewer("wall", {"lobby"});
  Program& old_booth = ready(start("booth", booth_place));
  Program& old_viewer = ready(start("listen", viewer_place));
  ASSERT_TRUE(hears_everything(old_viewer)) << old_viewer.output();
  // The viewer first: it hears the booth of the old identity.
  const std::string old_serial = daemon::read_credentials(viewer_place).certificate.serial;
  daemon::issue(fleet.path, {.role = daemon::Role::viewer, .name = "wall", .booths = {"lobby"}, .renew = true}, fleet.now);
  EXPECT_NE(daemon::read_credentials(viewer_place).certificate.serial, old_serial);
  Program& new_viewer = ready(start("listen", viewer_place));
  ASSERT_TRUE(hears_everything(new_viewer)) << new_viewer.output();
  // Then the booth: both viewers go on hearing it.
  daemon::issue(fleet.path, {.role = daemon::Role::booth, .name = "lobby", .booths = {}, .renew = true}, fleet.now);
  Program& new_booth = ready(start("booth", booth_place));
  old_booth.signal(SIGTERM);
  EXPECT_EQ(old_booth.wait(), 0);
  const auto total = [](const Program& p) { return count(p.output(), "total "); };
  const std::size_t old_before = total(old_viewer), new_before = total(new_viewer);
  EXPECT_TRUE(eventually([&] { return total(old_viewer) > old_before + 3 && total(new_viewer) > new_before + 3; }, kPatience))
      << "the viewers do not hear the booth's new identity: " << new_booth.output();
}

}  // namespace
}  // namespace booth::tests
