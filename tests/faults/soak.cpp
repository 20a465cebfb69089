// Sessions, idle and faults by turns, a sample in every session, and the comparison of both ends.
#include "tests/faults/soak.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <fstream>
#include <random>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/faults/booth.hpp"

namespace booth::tests {

using namespace std::chrono_literals;
using Clock = Unit::Clock;
namespace fs = std::filesystem;

namespace {

constexpr auto kPatience = std::chrono::seconds(180);
// What may differ between both ends without being a leak: pages that a longer session touched for the first time.
constexpr double kResidentGrowthKb = 16 * 1024, kDescriptorGrowth = 2, kThreadGrowth = 1;

double number_of(const std::string& status, const std::string& key) {
  const auto at = status.find("\n" + key + ":");
  return at == std::string::npos ? 0 : std::atof(status.c_str() + at + key.size() + 2);
}

std::vector<std::string> settings_of(const SoakPlan& plan) {
  // Old sessions go, or hours of them would fill the disk.
  std::vector<std::string> out{"session.quota_bytes=50000000", "session.max_age_days=0"};
  out.insert(out.end(), plan.settings.begin(), plan.settings.end());
  return out;
}

class Soak {
 public:
  Soak(const SoakPlan& plan, std::ostream& out)
      : plan_(plan), out_(out), random_(plan.seed), booth_(plan.folder / "booth", settings_of(plan)), begin_(Clock::now()) {}

  SoakVerdict run() {
    booth_.unit().start();
    if (!booth_.unit().wait_ready(0, kPatience)) return wrong("boothd does not become ready: " + booth_.unit().log());
    const auto time = [](double seconds) { return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000)); };
    for (int turn = 0; elapsed() < static_cast<double>(plan_.length.count()) && verdict_.wrong.empty(); ++turn) {
      one_session(time(plan_.session), !plan_.no_faults && turn % 3 == 2);
      std::this_thread::sleep_for(time(plan_.idle));
    }
    verdict_.starts = static_cast<int>(booth_.unit().state().starts);
    if (plan_.no_faults && verdict_.starts != 1) wrong(fmt::format("boothd was started {} times although nothing was done to it", verdict_.starts));
    verdict_.seconds = elapsed();
    judge();
    stop();
    return verdict_;
  }

 private:
  double elapsed() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }
  SoakVerdict wrong(const std::string& sentence) {
    verdict_.wrong.push_back(fmt::format("{:.0f} s: {}", elapsed(), sentence));
    out_ << verdict_.wrong.back() << std::endl;
    return verdict_;
  }

  void one_session(std::chrono::milliseconds length, bool strike) {
    const auto begun = booth_.ask("start");
    if (!begun || !begun->value("ok", false)) {
      wrong("a session is refused");
      return;
    }
    ++verdict_.sessions;
    const fs::path folder = booth_.session();
    std::this_thread::sleep_for(length);
    const auto status = booth_.ask("status");
    if (!status) {
      wrong("boothd does not answer");
      return;
    }
    sample(*status);
    booth_.ledger.struck(folder, status->value("frames", std::uint64_t{0}));
    if (strike) {
      fault();
    } else {
      booth_.ask("stop");
      if (!booth_.becomes("idle", kPatience)) wrong("a session does not end");
    }
    // Only of this session: older ones are deleted by the quota, as they should be.
    for (const auto& sentence : booth_.ledger.check()) wrong(sentence);
    booth_.ledger = {};
  }

  void stop() {
    if (booth_.unit().stop()) return;
    const std::string log = booth_.unit().log();
    wrong(fmt::format("boothd does not end with status 0 when it is told to (wait status {:#x}); its last words: {}", booth_.unit().state().last_status,
                      log.substr(log.size() - std::min<std::size_t>(log.size(), 2000))));
  }

  void fault() {
    const char* const kinds[] = {"kill -9", "kill -STOP", "processor taken for 3 s", "stop and start"};
    const auto kind = std::uniform_int_distribution<std::size_t>(0, 3)(random_);
    ++verdict_.faults[kinds[kind]];
    const Unit::State before = booth_.unit().state();
    const auto begin = Clock::now();
    bool again = true;
    switch (kind) {
      case 0:
        ::kill(before.pid, SIGKILL);
        break;
      case 1:
        ::kill(before.pid, SIGSTOP);
        break;
      case 2:
        ::kill(before.pid, SIGSTOP);
        std::this_thread::sleep_for(3s);
        ::kill(before.pid, SIGCONT);
        booth_.ask("stop");
        again = false;
        break;
      default:
        stop();
        booth_.unit().start();
    }
    if (again) {
      if (!booth_.unit().wait_ready(before.starts, kPatience)) {
        wrong(fmt::format("boothd does not come back after {}", kinds[kind]));
        return;
      }
      verdict_.ready_worst = std::max(verdict_.ready_worst, std::chrono::duration<double>(booth_.unit().state().ready_at - begin).count());
    }
    if (!eventually([&] { return booth_.whole() && booth_.state() == "idle"; }, kPatience))
      wrong(fmt::format("boothd does not work again after {}", kinds[kind]));
  }

  void sample(const nlohmann::json& status) {
    const pid_t pid = booth_.unit().state().pid;
    const std::string proc = fmt::format("/proc/{}", pid), text = read_text(proc + "/status");
    SoakSample s;
    s.at = elapsed();
    s.resident_kb = number_of(text, "VmRSS");
    s.threads = number_of(text, "Threads");
    std::error_code error;
    for (fs::directory_iterator it(proc + "/fd", error), end; !error && it != end; it.increment(error)) ++s.descriptors;
    if (status.contains("latency_ms") && status["latency_ms"].is_object()) s.p99_ms = status["latency_ms"].value("p99", 0.0);
    s.fps = status.value("fps", 0.0);
    if (s.resident_kb <= 0 || s.descriptors <= 0) return;
    verdict_.samples.push_back(s);
    out_ << fmt::format("{:7.0f} s  session {}  {:.1f} MiB  {:.0f} descriptors  {:.0f} threads  p99 {:.1f} ms  {:.1f} frames/s\n", s.at, verdict_.sessions,
                        s.resident_kb / 1024, s.descriptors, s.threads, s.p99_ms, s.fps);
    out_.flush();
  }

  SoakSample window(double from, double to) const {
    std::vector<SoakSample> in;
    for (const auto& s : verdict_.samples)
      if (s.at >= from && s.at <= to) in.push_back(s);
    SoakSample out;
    if (in.empty()) return out;
    const auto median = [&](double SoakSample::*what) {
      std::vector<double> values;
      for (const auto& s : in) values.push_back(s.*what);
      std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
      return values[values.size() / 2];
    };
    return {from,
            median(&SoakSample::resident_kb),
            median(&SoakSample::descriptors),
            median(&SoakSample::threads),
            median(&SoakSample::p99_ms),
            median(&SoakSample::fps)};
  }

  void judge() {
    const double width = plan_.window * 60;
    verdict_.first = window(0, width);
    verdict_.last = window(verdict_.seconds - width, verdict_.seconds);
    const SoakSample &a = verdict_.first, &b = verdict_.last;
    if (a.resident_kb <= 0 || b.resident_kb <= 0) {
      wrong("a window holds no sample: it is shorter than a session");
      return;
    }
    if (b.resident_kb > a.resident_kb + kResidentGrowthKb) wrong(fmt::format("resident memory grew from {:.0f} to {:.0f} KiB", a.resident_kb, b.resident_kb));
    if (b.descriptors > a.descriptors + kDescriptorGrowth) wrong(fmt::format("descriptors grew from {} to {}", a.descriptors, b.descriptors));
    if (b.threads > a.threads + kThreadGrowth) wrong(fmt::format("threads grew from {} to {}", a.threads, b.threads));
  }

  const SoakPlan plan_;
  std::ostream& out_;
  std::mt19937_64 random_;
  Booth booth_;
  const Clock::time_point begin_;
  SoakVerdict verdict_;
};

struct Line {
  const char* what;
  double first, last;
  const char* bound;
};

std::vector<Line> lines(const SoakVerdict& v) {
  return {{"resident memory, MiB", v.first.resident_kb / 1024, v.last.resident_kb / 1024, "at most 16 more"},
          {"descriptors", v.first.descriptors, v.last.descriptors, "at most 2 more"},
          {"threads", v.first.threads, v.last.threads, "at most 1 more"},
          {"latency p99, ms", v.first.p99_ms, v.last.p99_ms, "compared, not judged: other work on the machine is in it"},
          {"frames/s", v.first.fps, v.last.fps, "compared, not judged"}};
}

std::string faults_text(const SoakVerdict& v) {
  std::string out;
  for (const auto& [kind, times] : v.faults) out += fmt::format("{}{} x {}", out.empty() ? "" : ", ", times, kind);
  return out.empty() ? "none" : out;
}

}  // namespace

SoakVerdict soak(const SoakPlan& plan, std::ostream& out) { return Soak(plan, out).run(); }

void print_text(std::ostream& out, const SoakVerdict& v) {
  out << fmt::format("soak of {:.0f} s: {} sessions, faults: {}; {} starts, READY at most {:.1f} s after a fault\n", v.seconds, v.sessions, faults_text(v),
                     v.starts, v.ready_worst);
  for (const auto& line : lines(v)) out << fmt::format("  {:<22} first {:8.1f}  last {:8.1f}  {}\n", line.what, line.first, line.last, line.bound);
  for (const auto& sentence : v.wrong) out << "  WRONG " << sentence << "\n";
  if (v.wrong.empty()) out << "  as expected\n";
}

std::string to_markdown(const SoakVerdict& v) {
  std::string out = fmt::format(
      "{:.2f} hours, {} sessions, faults: {}; {} starts of boothd, READY at most {:.1f} s after a fault. {}\n\n| | first window | last window | allowed "
      "|\n|---|---|---|---|\n",
      v.seconds / 3600, v.sessions, faults_text(v), v.starts, v.ready_worst, v.wrong.empty() ? "As expected." : "**Wrong:** " + v.wrong.front());
  for (const auto& line : lines(v)) out += fmt::format("| {} | {:.1f} | {:.1f} | {} |\n", line.what, line.first, line.last, line.bound);
  return out;
}

std::string to_json(const SoakVerdict& v) {
  nlohmann::json j{{"seconds", v.seconds}, {"sessions", v.sessions}, {"starts", v.starts}, {"ready_worst_seconds", v.ready_worst},
                   {"faults", v.faults},   {"wrong", v.wrong}};
  for (const auto& line : lines(v)) j["compared"].push_back({{"what", line.what}, {"first", line.first}, {"last", line.last}, {"allowed", line.bound}});
  for (const auto& s : v.samples)
    j["samples"].push_back(
        {{"at", s.at}, {"resident_kb", s.resident_kb}, {"descriptors", s.descriptors}, {"threads", s.threads}, {"p99_ms", s.p99_ms}, {"fps", s.fps}});
  return j.dump(2) + "\n";
}

}  // namespace booth::tests
