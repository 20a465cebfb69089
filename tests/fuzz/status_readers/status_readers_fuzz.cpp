// What boothctl makes of a boothd's status, whatever boothd answers: the gate, metrics and the support bundle.
#include <string>

#include "daemon/ctl/health_gate.hpp"
#include "daemon/ctl/metrics_text.hpp"
#include "daemon/ctl/support_bundle.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::require;

/// A status that has everything, with one part replaced by what the input says.
StatusJson status_of(booth::fuzz::Input& in) {
  static const StatusJson whole =
      StatusJson::parse(R"({"ok":true,"state":"idle","degraded":false,"paused":false,"emergency_latched":false,"panel":{"present":true},
    "alarm":"","cameras":[{"name":"a","state":"running","fps":30,"delivered":5,"dropped":0,"corrupt":0,"restarts":0,"problem":""}],"cameras_minimum":1,"groups":1,
    "frames":1,"fps":30,"latency_ms":{"count":1,"p50":1,"p95":1,"p99":1,"max":1,"mean":1},"stage_ms":{"fit":{"p50":1}},"backend":{"name":"cpu"},"recorder":{}})");
  StatusJson out = whole;
  auto it = out.begin();
  std::advance(it, in.u8() % out.size());
  const auto rest = in.bytes(4096);
  const StatusJson part = StatusJson::parse(std::string(reinterpret_cast<const char*>(rest.data()), rest.size()), nullptr, false);
  if (!part.is_discarded()) *it = part;
  return out;
}

void read(const StatusJson& status) {
  HealthGate gate({.frames = 2, .every_camera = true});
  for (int i = 0; i < 2; ++i) require(!gate.look(status).sentence.empty(), "a verdict is a sentence");
  const std::string metrics = metrics_text(status);
  require(metrics.ends_with("\n"), "metrics end in a line");
  for (std::size_t at = 0, end; (end = metrics.find('\n', at)) != std::string::npos; at = end + 1) {
    const std::string line = metrics.substr(at, end - at);
    require(line.starts_with("boothd_") || line.starts_with("# "), "every line is a metric or its explanation");
  }
  for (const char c : status_for_report(status))
    require(static_cast<unsigned char>(c) < 0x80 && (static_cast<unsigned char>(c) >= 0x20 || c == '\n'), "a report is text");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  if (const StatusJson any = StatusJson::parse(text, nullptr, false); !any.is_discarded()) read(any);
  booth::fuzz::Input in(data, size);
  read(status_of(in));
  const std::string without = without_session_names(text);
  require(without_session_names(without) == without, "what was left out stays out");
  return 0;
}
