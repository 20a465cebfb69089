// A box is up before the switch that it hangs on: boothd works without DDS, says so, and begins anew when the network is there.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "daemon/ctl/control_client.hpp"
#include "tests/daemon/dds/network/namespaces.hpp"
#include "tests/daemon/support/program.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;

constexpr int kAgain = 75;
constexpr auto kPatience = 60s;

/// What the child found: 0 as it should be, 1 not permitted here, otherwise the step that failed.
int late_network(const TemporaryFolder& folder, const std::string& interface, const std::string& alarm) {
  if (!enter_own_network().empty()) return 1;
  ::close(open_cable("gone0", "10.98.0.1"));                       // its interface goes with it; lo stays up
  ::setenv("NOTIFY_SOCKET", (folder.path / "nobody").c_str(), 1);  // somebody would start boothd again
  const std::string socket = (folder.path / "c.sock").string();
  Program boothd("boothd",
                 {"--set", "control.socket=" + socket, "--set", "session.directory=" + (folder.path / "s").string(), "--set",
                  "record.directory=" + (folder.path / "r").string(), "--set", "cameras.synthetic.count=2", "--set", "fit.sex=men", "--set", "fit.threads=1",
                  "--set", "dds.security=off", "--set", "dds.interface=" + interface},
                 folder.path / "boothd");
  const auto ask = [&](const char* what) {
    try {
      return nlohmann::json::parse(daemon::ControlClient(socket).ask(nlohmann::json{{"request", what}}.dump()));
    } catch (const std::exception&) {
      return nlohmann::json{{"state", "none"}};
    }
  };
  if (!eventually([&] { return ask("status")["state"] == "idle"; }, kPatience)) return 2;
  if (ask("status").value("alarm", "?").find(alarm) == std::string::npos) return 3;
  // Captures need no network, and are not broken off for one.
  if (!ask("start").value("ok", false)) return 4;
  const int cable = open_cable("booth0", "10.99.0.1");
  if (!eventually([&] { return ask("status")["state"] == "tracking"; }, kPatience)) return 5;
  ask("stop");
  const int status = boothd.wait(kPatience);
  ::close(cable);
  return status == kAgain ? 0 : 100 + (status & 0x7f);
}

int in_a_child(const std::function<int()>& work) {
  const pid_t pid = ::fork();
  if (pid == 0) {
    int status = 99;
    try {
      status = work();
    } catch (const std::exception&) {
    }
    ::_exit(status);
  }
  int status = 0;
  ::waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(LateNetwork, TheInterfaceThatWasNamedComesLater) {
  const TemporaryFolder folder;
  const int found = in_a_child([&] { return late_network(folder, "booth0", "no interface booth0"); });
  if (found == 1) GTEST_SKIP() << "skipped: a network namespace of its own is not permitted here";
  EXPECT_EQ(found, 0) << read_text(folder.path / "boothd.err");
}

TEST(LateNetwork, AnyNetworkComesLater) {
  const TemporaryFolder folder;
  const int found = in_a_child([&] { return late_network(folder, "", ""); });
  if (found == 1) GTEST_SKIP() << "skipped: a network namespace of its own is not permitted here";
  EXPECT_EQ(found, 0) << read_text(folder.path / "boothd.err");
}

}  // namespace
}  // namespace booth::tests
