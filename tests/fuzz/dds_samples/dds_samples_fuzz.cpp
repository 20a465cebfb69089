// What comes in on DDS, after the library has taken it apart: commands in any order and number, and samples of booths with any texts and numbers.
#include <bit>
#include <string>

#include "daemon/ctl/fleet_report.hpp"
#include "daemon/ctl/stick_figure.hpp"
#include "daemon/dds/command_guard.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::Input;
using booth::fuzz::require;

std::string text(Input& in) {
  const auto bytes = in.bytes(in.u8() % 64);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void check_printable(const std::string& shown) {
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const auto c = static_cast<unsigned char>(shown[i]);
    require((c >= 0x20 || c == '\n') && c != 0x7f, "no control character reaches a terminal");
    require(!(c == 0xC2 && i + 1 < shown.size() && static_cast<unsigned char>(shown[i + 1]) >= 0x80 && static_cast<unsigned char>(shown[i + 1]) < 0xA0),
            "nor one of those beyond ASCII");
  }
}

void command(Input& in) {
  constexpr std::int64_t kBegan = 1'800'000'000'000'000'000;
  int done = 0;
  std::int64_t now_ns = 0;
  CommandGuard guard(
      1, booth::hal::MonotonicTime(),
      [&](DdsCommand kind) {
        require(kind <= DdsCommand::snapshot, "only what there is is carried out");
        ++done;
        return DdsAnswer{true, 1, "done"};
      },
      [] { return std::uint8_t{0}; });
  int asked = 0;
  for (; !in.empty() && asked < 200; ++asked) {
    const unsigned how = in.u8();
    now_ns += in.u16() * std::int64_t{1'000'000};
    RemoteCommand c{.writer = in.u8() % 4u,
                    .version = how & 1 ? 1u : in.u32(),
                    .sender = how & 2 ? "desk" : text(in),
                    .id = in.u8() % 8u,
                    .utc_ns = 0,
                    .kind = in.u8() % 6u};
    // Most are of now; some of any time.
    c.utc_ns = how & 4 ? static_cast<std::int64_t>(std::uint64_t{in.u32()} << 32 | in.u32()) : kBegan + now_ns;
    (void)guard.handle(c, kBegan + now_ns, booth::hal::MonotonicTime(std::chrono::nanoseconds(now_ns)));
  }
  require(done <= asked, "no command is carried out twice");
  require(done <= CommandGuard::kAllBurst + CommandGuard::kAllPerSecond * (static_cast<double>(now_ns) / 1e9) + 1, "no more than the rate allows");
}

void fleet(Input& in) {
  std::map<std::string, HeardBooth> booths;
  std::array<std::array<double, 3>, 24> joints{};
  while (!in.empty() && booths.size() < 8) {
    HeardBooth& booth = booths[text(in)];
    const unsigned flags = in.u8();
    booth.status_known = flags & 1, booth.skeleton_known = flags & 2, booth.present = flags & 4, booth.twice = flags & 8;
    StatusSample& s = booth.status;
    s.state = in.u8(), s.alarm = text(in), s.session = text(in), s.software = text(in);
    for (unsigned i = in.u8() % 3; i > 0; --i) s.faults.emplace_back(text(in), text(in));
    for (unsigned i = in.u8() % 3; i > 0; --i)
      s.cameras.push_back({.name = text(in), .state = text(in), .fps = std::bit_cast<float>(in.u32()), .delivered = in.u32(), .dropped = 0, .restarts = 0});
    s.fps = std::bit_cast<float>(in.u32()), s.residual = std::bit_cast<float>(in.u32()), s.latency_p50_ms = std::bit_cast<float>(in.u32());
    const auto number = [&in] { return std::bit_cast<double>(std::uint64_t{in.u32()} << 32 | in.u32()); };
    s.calibration_age_s = number(), s.calibration_residual = number();
    s.disk_free_bytes = static_cast<std::int64_t>(std::uint64_t{in.u32()} << 32 | in.u32());
    for (auto& joint : joints)
      for (double& x : joint) x = (flags & 16) != 0 ? number() : in.u8() / 64.0;
  }
  const auto rows = fleet_rows(booths, {"expected", text(in)});
  check_printable(fleet_table(rows));
  require(!fleet_json(rows).empty() && unwell(rows) >= 0, "a fleet can be told of");
  const int columns = 1 + in.u8() % 80, lines = 1 + in.u8() % 40;
  require(stick_figure(joints, columns, lines).size() <= static_cast<std::size_t>((columns + 1) * lines), "a figure stays in its frame");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  check_printable(printable(std::string(reinterpret_cast<const char*>(data), size)));
  Input in(data, size);
  if (in.u8() % 2 == 0)
    command(in);
  else
    fleet(in);
  return 0;
}
