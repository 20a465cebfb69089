// Boothd is killed, stopped, starved of processor and of memory, at moments that nobody chose.
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>

#include <fstream>
#include <functional>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/faults/booth.hpp"
#include "tests/faults/faults.hpp"

namespace booth::tests {

using namespace std::chrono_literals;
using Clock = Unit::Clock;

namespace {

// Until then something must have happened, however busy the machine; the promises are judged by the report.
constexpr auto kPatience = std::chrono::seconds(180);

double since(Clock::time_point begin, Clock::time_point end = Clock::now()) { return std::chrono::duration<double>(end - begin).count(); }

std::chrono::milliseconds random_time(FaultPlan& plan, int least, int most) {
  return std::chrono::milliseconds(std::uniform_int_distribution(least, most)(plan.random));
}

/// Takes boothd through what it does all day, strikes at a random moment, and sees what has become of it.
struct Rounds {
  FaultPlan& plan;
  FaultRow& row;
  std::function<void(pid_t)> strike;
  std::map<std::string, int> states{};

  bool one(Booth& booth, int round) {
    std::string why;
    // Now and then a session that nothing happens to: it must outlive all that follows.
    if (round % 10 == 0 && !booth.visit(2s, why)) return wrong(why);
    if (round % 5 != 4) {
      booth.ask("start");
      std::this_thread::sleep_for(random_time(plan, 0, 5000));
      if (round % 5 == 3) {
        booth.ask("stop");
        std::this_thread::sleep_for(random_time(plan, 0, 60));
      }
    }
    const auto status = booth.ask("status");
    if (!status) return wrong(fmt::format("round {}: boothd does not answer before the fault", round));
    ++states[status->value("state", "?")];
    booth.ledger.struck(booth.session(), status->value("state", "idle") == "idle" ? 0 : status->value("frames", std::uint64_t{0}));
    const Unit::State before = booth.unit().state();
    const auto begin = Clock::now();
    strike(before.pid);
    if (!booth.unit().wait_ready(before.starts, kPatience)) return wrong(fmt::format("round {}: boothd does not come back", round));
    row.ready(since(begin, booth.unit().state().ready_at));
    if (!eventually([&] { return booth.whole(); }, kPatience)) return wrong(fmt::format("round {}: the cameras do not come back", round));
    row.whole(since(begin));
    for (auto& sentence : booth.ledger.check()) row.wrong.push_back(fmt::format("round {}: {}", round, sentence));
    ++row.times;
    return true;
  }
  bool wrong(const std::string& sentence) {
    row.wrong.push_back(sentence);
    return false;
  }
  void all(const std::string& name) {
    Booth booth(plan.folder / name);
    booth.unit().start();
    if (!booth.unit().wait_ready(0, kPatience)) {
      wrong("boothd does not become ready: " + booth.unit().log());
      return;
    }
    for (int round = 0; round < plan.times && one(booth, round); ++round) {
    }
    for (const auto& [state, count] : states) row.seen += fmt::format("{}{} while {}", row.seen.empty() ? "" : ", ", count, state);
    row.seen += fmt::format("; {} sessions kept, {} of them marked interrupted", booth.ledger.sessions(), booth.ledger.interrupted());
  }
};

}  // namespace

FaultRow killed(FaultPlan& plan) {
  FaultRow row{.fault = "kill -9 of boothd at a random moment", .expected = "started again; sessions and all but the last second of the running one are kept"};
  Rounds{plan, row, [](pid_t pid) { ::kill(pid, SIGKILL); }}.all("kill");
  return row;
}

FaultRow stopped(FaultPlan& plan) {
  FaultRow row{.fault = "kill -STOP of boothd at a random moment",
               .expected = "the watchdog ends it and it is started again; nothing is lost but the last second"};
  Rounds{plan, row, [](pid_t pid) { ::kill(pid, SIGSTOP); }}.all("stop");
  return row;
}

FaultRow processor_stolen(FaultPlan& plan) {
  FaultRow row{.fault = "the processor is taken away, two seconds of every two and a half, during a session",
               .expected = "boothd lives on, drops frames and says so, and the session is complete"};
  Booth booth(plan.folder / "stolen");
  booth.unit().start();
  if (!booth.unit().wait_ready(0, kPatience)) {
    row.wrong.push_back("boothd does not become ready");
    return row;
  }
  const Unit::State before = booth.unit().state();
  booth.ask("start");
  const auto folder = booth.session();
  std::this_thread::sleep_for(2s);
  for (; row.times < std::max(2, plan.times / 5); ++row.times) {
    ::kill(before.pid, SIGSTOP);
    std::this_thread::sleep_for(2s);
    ::kill(before.pid, SIGCONT);
    std::this_thread::sleep_for(500ms);
  }
  const auto begin = Clock::now();
  if (!eventually([&] { return booth.whole(); }, kPatience)) row.wrong.push_back("the cameras do not come back");
  row.ready(since(begin));
  row.whole(since(begin));
  if (booth.unit().state().starts != before.starts) row.wrong.push_back("boothd ended");
  booth.ask("stop");
  if (!booth.becomes("idle", kPatience)) row.wrong.push_back("the session does not end");
  std::ifstream in(folder / "session.json");
  const auto j = nlohmann::json::parse(in, nullptr, false);
  if (!j.is_object() || j.value("result", "") != "complete") row.wrong.push_back("the session is not complete");
  if (j.is_object()) row.seen = fmt::format("{} frames fitted, {} groups dropped", j.value("frames", 0), j.value("groups_dropped", 0));
  return row;
}

FaultRow memory_limit(FaultPlan& plan) {
  FaultRow row{.fault = "not a page more memory, from a random moment of a session on",
               .expected = "goes on with what it has, or is started again; nothing is lost but the last second"};
  int lived = 0;
  Booth booth(plan.folder / "memory");
  booth.unit().start();
  for (int round = 0; round < std::max(2, plan.times / 5); ++round, ++row.times) {
    if (!eventually([&] { return booth.whole(); }, kPatience)) {
      row.wrong.push_back("boothd does not become whole");
      return row;
    }
    booth.ask("start");
    std::this_thread::sleep_for(random_time(plan, 100, 3000));
    const auto status = booth.ask("status");
    booth.ledger.struck(booth.session(), status ? status->value("frames", std::uint64_t{0}) : 0);
    const Unit::State before = booth.unit().state();
    // The address space is as large as it is: every further mapping fails.
    std::ifstream statm(fmt::format("/proc/{}/statm", before.pid));
    rlim_t pages = 0;
    statm >> pages;
    const rlimit limit{pages * 4096, RLIM_INFINITY};
    if (::prlimit(before.pid, RLIMIT_AS, &limit, nullptr) != 0) {
      row.skipped = "a process's limits cannot be changed here";
      return row;
    }
    const auto begin = Clock::now();
    std::this_thread::sleep_for(1s);
    booth.ask("stop");
    eventually([&] { return booth.unit().state().starts > before.starts || booth.state() == "idle"; }, 60s);
    const Unit::State after = booth.unit().state();
    if (after.starts > before.starts || after.pid != before.pid) {
      if (!booth.unit().wait_ready(before.starts, kPatience)) {
        row.wrong.push_back("boothd does not come back");
        return row;
      }
      row.ready(since(begin, booth.unit().state().ready_at));
    } else {
      ++lived;
      const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
      ::prlimit(before.pid, RLIMIT_AS, &none, nullptr);
      row.ready(since(begin));
    }
    if (!eventually([&] { return booth.whole() && booth.state() == "idle"; }, kPatience)) {
      row.wrong.push_back("boothd lives and does not work: " + booth.state());
      return row;
    }
    row.whole(since(begin));
    for (auto& sentence : booth.ledger.check()) row.wrong.push_back(sentence);
  }
  row.seen = fmt::format("{} times it ended its session and lived on, {} times it was started again", lived, row.times - lived);
  return row;
}

}  // namespace booth::tests
