// What a client may write to the control socket, in pieces of any size: each line gets one line of JSON with `ok`, and nothing else happens.
#include <sys/socket.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "daemon/ctl/control_protocol.hpp"
#include "daemon/ctl/control_server.hpp"
#include "daemon/ctl/panel_protocol.hpp"
#include "daemon/ctl/record_protocol.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth;
using namespace std::chrono_literals;
using fuzz::require;

class Recorder final : public hal::FlightRecorder {
 public:
  void frame(const hal::DepthFrame&) noexcept override {}
  void fitted(const hal::FittedGroup&) noexcept override {}
  void event(const std::string&, const std::string&, const std::string&) override {}
  std::string record(bool, bool, double seconds, hal::Nanoseconds) override {
    require(seconds > 0 && seconds <= daemon::kLongestRecording, "a recording has a length");
    return "not here";
  }
  void stop() override {}
  std::string snapshot(const std::string&) override { return ""; }
  hal::RecorderStatus status(bool) override { return {}; }
};

/// A booth without cameras that see anything: sessions are not what is tried here, so that requests to start and stop them are left out.
struct Booth {
  Booth() {
    for (int i = 0; i < 2; ++i) cameras.push_back(std::make_unique<tests::FakeCamera>("c\"\xff", clock, 0ms, 1'000'000'000, true));
    daemon::ControllerSettings settings;
    settings.session_directory = scratch.path() / "sessions";
    controller = std::make_unique<daemon::Controller>(settings, clock);
    pipeline = std::make_unique<daemon::Pipeline>(daemon::Pipeline::Settings{.minimum_cameras = 1, .synchroniser = {}}, cameras, clock, fitter, *controller);
    controller->run(*pipeline, fitter, nullptr);
    server = std::make_unique<daemon::ControlServer>(path, [this](const std::string& line) { return answer(line); });
  }
  ~Booth() {
    server.reset();
    controller->shutdown("done");
  }
  std::string answer(const std::string& line) {
    require(line.find('\n') == std::string::npos, "a request is one line");
    if (auto text = daemon::answer_panel_request(line, nullptr)) return *text;
    if (auto text = daemon::answer_record_request(line, recorder)) return daemon::with_recorder(*text, recorder);
    const auto request = nlohmann::json::parse(line, nullptr, false);
    if (request.is_object() && request.contains("request") && (request["request"] == "start" || request["request"] == "stop")) return R"({"ok":true})";
    return daemon::with_recorder(daemon::answer_request(line, *controller), recorder);
  }

  fuzz::Scratch scratch;
  std::filesystem::path path = scratch.path() / "c.sock";
  drivers::SystemClock clock;
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  Recorder recorder;
  std::unique_ptr<daemon::Controller> controller;
  std::unique_ptr<daemon::Pipeline> pipeline;
  std::unique_ptr<daemon::ControlServer> server;
};

void send_pieces(int socket, const std::string& bytes, std::size_t piece) {
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    if (!daemon::send_all(socket, std::string_view(bytes).substr(at, piece), 2s)) return;
}

std::string received(int socket) {
  std::string out;
  char buffer[4096];
  for (ssize_t n; (n = ::recv(socket, buffer, sizeof buffer, 0)) > 0;) out.append(buffer, static_cast<std::size_t>(n));
  return out;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Booth booth;
  fuzz::Input in(data, size);
  const std::size_t piece = 1 + in.u8();
  const std::size_t repeat = 1 + in.u8() % 40;  // long lines are made here
  const auto rest = in.bytes(size);
  std::string bytes;
  for (std::size_t i = 0; i < repeat; ++i) bytes.append(reinterpret_cast<const char*>(rest.data()), rest.size());
  const daemon::UniqueFd client = daemon::connect_unix(booth.path);
  send_pieces(client.get(), bytes, piece);
  ::shutdown(client.get(), SHUT_WR);
  const std::string answers = received(client.get());
  require(answers.empty() || answers.back() == '\n', "answers are whole lines");
  std::size_t lines = 0;
  for (std::size_t at = 0, end; (end = answers.find('\n', at)) != std::string::npos; at = end + 1, ++lines) {
    const auto answer =
        nlohmann::json::parse(answers.begin() + static_cast<std::ptrdiff_t>(at), answers.begin() + static_cast<std::ptrdiff_t>(end), nullptr, false);
    require(answer.is_object() && answer.contains("ok") && answer["ok"].is_boolean(), "an answer is a JSON object with ok");
  }
  const auto asked = static_cast<std::size_t>(std::count(bytes.begin(), bytes.end(), '\n'));
  require(lines <= asked + 1, "nobody is answered without asking");
  return 0;
}
