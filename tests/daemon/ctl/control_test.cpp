// The control socket answers everything with one JSON object a line: requests, garbage, half lines, lines without end.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/control_protocol.hpp"
#include "daemon/ctl/control_server.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;

struct ControlTest : ::testing::Test {
  ControlTest() {
    for (int i = 0; i < 2; ++i) cameras.push_back(std::make_unique<tests::FakeCamera>("c\"\xff" + std::to_string(i), clock, i * 8ms, 1'000'000, true));
    ControllerSettings settings;
    settings.session_directory = folder.path / "sessions";
    controller = std::make_unique<Controller>(settings, clock);
    pipeline = std::make_unique<Pipeline>(Pipeline::Settings{.minimum_cameras = 1, .synchroniser = {}}, cameras, clock, fitter, *controller);
    controller->run(*pipeline, fitter, nullptr);
    server = std::make_unique<ControlServer>(path, [this](const std::string& line) { return answer_request(line, *controller); });
  }
  ~ControlTest() override {
    server.reset();
    controller->shutdown("test");
  }
  json ask(const std::string& line) {
    ControlClient client(path);
    return json::parse(client.ask(line));
  }

  drivers::SystemClock clock;
  tests::TemporaryFolder folder;
  std::filesystem::path path = folder.path / "run" / "control.sock";
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  std::unique_ptr<Controller> controller;
  std::unique_ptr<Pipeline> pipeline;
  std::unique_ptr<ControlServer> server;
};

TEST_F(ControlTest, StatusStartStop) {
  const json status = ask(R"({"request":"status"})");
  EXPECT_EQ(status["state"], "idle");
  ASSERT_EQ(status["cameras"].size(), 2u) << "a name that is not UTF-8 must not end the conversation";
  EXPECT_EQ(ask(R"({"request":"skeleton"})")["known"], false);
  EXPECT_EQ(ask(R"({"request":"stop"})")["error"], "no session is running");
  EXPECT_EQ(ask(R"({"request":"start"})")["state"], "estimating");
  ASSERT_TRUE(tests::eventually([&] { return ask(R"({"request":"status"})")["state"] == "tracking"; }));
  const json skeleton = ask(R"({"request":"skeleton"})");
  EXPECT_EQ(skeleton["joints"].size(), 24u);
  EXPECT_EQ(skeleton["person"], "tracked");
  EXPECT_EQ(ask(R"({"request":"stop"})")["ok"], true);
  ASSERT_TRUE(tests::eventually([&] { return ask(R"({"request":"status"})")["state"] == "idle"; }));
  EXPECT_EQ(ask(R"({"request":"status"})")["last_session"]["result"], "complete");
}

TEST_F(ControlTest, GarbageIsAnsweredAndTheConnectionGoesOn) {
  ControlClient client(path);
  for (const std::string line : {"", "hello", "{", "[1,2]", "null", R"({"request":7})", R"({"request":"reboot"})", "\x01\x02\xff", R"({"request":)"}) {
    const json answer = json::parse(client.ask(line));
    EXPECT_EQ(answer["ok"], false) << line;
    EXPECT_FALSE(answer["error"].get<std::string>().empty());
  }
  EXPECT_EQ(json::parse(client.ask(R"({"request":"status"})"))["ok"], true);
  const std::string deep(4000, '[');
  EXPECT_EQ(json::parse(client.ask(deep))["ok"], false);
}

TEST_F(ControlTest, ALineWithoutEndIsCutOff) {
  UniqueFd fd = connect_unix(path);
  const std::string flood(1 << 20, 'x');
  send_all(fd.get(), flood, 500ms);  // the server may close before it has all of it
  std::string answer(300, 0);
  const ssize_t n = ::recv(fd.get(), answer.data(), answer.size(), 0);
  if (n > 0) {
    EXPECT_THAT(answer.substr(0, static_cast<std::size_t>(n)), HasSubstr("at most 4096 bytes"));
  }
  EXPECT_EQ(ask(R"({"request":"status"})")["ok"], true) << "others are served as before";
}

TEST_F(ControlTest, RequestsMayComeInPieces) {
  UniqueFd fd = connect_unix(path);
  for (const char c : std::string("{\"request\":\"status\"}\n{\"request\":\"skeleton\"}\n")) ASSERT_TRUE(send_all(fd.get(), std::string(1, c), 1s));
  std::string text;
  ASSERT_TRUE(tests::eventually([&] {
    char buffer[4096];
    const ssize_t n = ::recv(fd.get(), buffer, sizeof buffer, MSG_DONTWAIT);
    if (n > 0) text.append(buffer, static_cast<std::size_t>(n));
    return std::count(text.begin(), text.end(), '\n') == 2;
  }));
}

TEST_F(ControlTest, TooManyClientsAreToldSo) {
  std::vector<UniqueFd> idle;
  for (std::size_t i = 0; i < ControlServer::kMostClients; ++i) idle.push_back(connect_unix(path));
  std::this_thread::sleep_for(200ms);
  UniqueFd extra = connect_unix(path);
  std::string answer(100, 0);
  const ssize_t n = ::recv(extra.get(), answer.data(), answer.size(), 0);
  ASSERT_GT(n, 0);
  EXPECT_THAT(answer, HasSubstr("too many clients"));
  idle.clear();
  ASSERT_TRUE(tests::eventually([&] {
    try {
      return ask(R"({"request":"status"})")["ok"] == true;
    } catch (const std::exception&) {
      return false;
    }
  }));
}

TEST(ControlServer, ClientsThatHangDoNotLockOthersOut) {
  tests::TemporaryFolder folder;
  const auto path = folder.path / "s";
  const ControlServer server(
      path, listen_unix(path), [](const std::string& line) { return line; }, 100ms);
  std::vector<UniqueFd> silent;
  for (std::size_t i = 0; i < 2 * ControlServer::kMostClients; ++i) {
    silent.push_back(connect_unix(path));
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_TRUE(tests::eventually([&] {
    try {
      return ControlClient(path).ask("stop") == "stop";
    } catch (const std::exception&) {
      return false;  // too many clients: they have not been silent for long enough yet
    }
  }));
}

TEST(ControlServer, WithoutADescriptorItWaitsAndDoesNotSpin) {
  tests::TemporaryFolder folder;
  const auto path = folder.path / "s";
  const ControlServer server(path, [](const std::string& line) { return line; });
  rlimit before{};
  ::getrlimit(RLIMIT_NOFILE, &before);
  const rlimit few{std::min<rlim_t>(before.rlim_cur, 64), before.rlim_max};
  ::setrlimit(RLIMIT_NOFILE, &few);
  std::vector<UniqueFd> all;
  for (int fd; (fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC)) >= 0;) all.emplace_back(fd);
  ASSERT_FALSE(all.empty());
  all.pop_back();
  const UniqueFd client = connect_unix(path);  // takes the last one
  const auto processor = [] {
    rusage used{};
    ::getrusage(RUSAGE_SELF, &used);
    return std::chrono::seconds(used.ru_utime.tv_sec + used.ru_stime.tv_sec) + std::chrono::microseconds(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
  };
  const auto begin = processor();
  std::this_thread::sleep_for(500ms);
  EXPECT_LT(processor() - begin, 100ms) << "of processor, whatever else the machine does";
  all.clear();
  ::setrlimit(RLIMIT_NOFILE, &before);
  ASSERT_TRUE(send_all(client.get(), "still there\n", 1s));
  char answer[32] = {};
  EXPECT_GT(::recv(client.get(), answer, sizeof answer - 1, 0), 0);
  EXPECT_STREQ(answer, "still there\n");
}

TEST_F(ControlTest, TheSocketIsForTheGroupAndGoesAway) {
  struct stat info {};
  ASSERT_EQ(::stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0660u);
  EXPECT_THROW(listen_unix(path), std::runtime_error) << "another boothd is running";
  server.reset();
  EXPECT_NE(::stat(path.c_str(), &info), 0);
  try {
    connect_unix(path);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("boothd is not running"));
  }
}

TEST(UnixSocket, WhoeverTakesNoConnectionIsNotWaitedForForEver) {
  tests::TemporaryFolder folder;
  const auto path = folder.path / "s";
  const UniqueFd deaf = listen_unix(path);
  std::vector<UniqueFd> queue;
  std::string complaint;
  for (int i = 0; i < 64 && complaint.empty(); ++i) try {
      queue.push_back(connect_unix(path));
    } catch (const std::runtime_error& e) {
      complaint = e.what();
    }
  EXPECT_THAT(complaint, HasSubstr("does not answer"));
  EXPECT_THROW(listen_unix(path), std::runtime_error) << "it is there all the same";
  EXPECT_TRUE(std::filesystem::is_socket(path));
}

TEST(UnixSocket, ALeftOverSocketIsReplacedAFileIsNot) {
  tests::TemporaryFolder folder;
  const auto path = folder.path / "s";
  { UniqueFd dead = listen_unix(path); }
  EXPECT_NO_THROW(listen_unix(path));
  const auto file = folder.write("file", "precious");
  EXPECT_THROW(listen_unix(file), std::runtime_error);
  EXPECT_EQ(tests::read_text(file), "precious");
  EXPECT_THROW(listen_unix(folder.path / std::string(200, 'x')), std::runtime_error);
}

}  // namespace
}  // namespace booth::daemon
