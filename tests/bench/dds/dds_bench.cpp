// booth-bench dds: our publish to take in another process, and ddsperf's ping of the same payload, in turns in one run; in the plain, and with DDS Security.
#include <dds/dds.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>

#include "booth.h"
#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/bench/dds/bench_identity.hpp"
#include "tests/bench/dds/ddsperf.hpp"
#include "tests/bench/dds/mirror_cost.hpp"
#include "tests/bench/harness/harness.hpp"

namespace booth::bench {
namespace {

using daemon::DdsTopic;

constexpr std::size_t kMost = 100'000;
constexpr std::uint32_t kShape = 20;

/// Nanoseconds, written by one thread.
struct Times {
  std::atomic<std::uint64_t> count{0};
  std::array<std::int64_t, kMost> ns{};
  void add(std::int64_t one) {
    const std::uint64_t n = count.load(std::memory_order_relaxed);
    if (n == kMost) return;
    ns[n] = one;
    count.store(n + 1, std::memory_order_release);
  }
};

/// Shared by the two processes.
struct Board {
  std::atomic<bool> end{false};
  Times one_way, round_trip;
};

std::int64_t monotonic_ns() {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::int64_t>(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

/// Hears one booth's skeletons as ddsperf hears pings: in the library's receiving thread (listener) or in a thread of its own (waitset).
class Ear {
 public:
  using Heard = std::function<void(const booth_msg_Skeleton&, std::int64_t now)>;
  Ear(const daemon::DdsSettings& settings, bool listener, Heard heard) : dds_(settings), heard_(std::move(heard)) {
    const daemon::DdsQos qos;
    daemon::set_topic_qos(DdsTopic::skeleton, qos);
    const dds_entity_t topic = dds_create_topic(dds_.participant(), &booth_msg_Skeleton_desc, "booth/skeleton", nullptr, nullptr);
    dds_listener_t* ear = dds_create_listener(this);
    if (listener) dds_lset_data_available(ear, [](dds_entity_t reader, void* self) { static_cast<Ear*>(self)->take_all(reader); });
    reader_ = dds_create_reader(dds_.subscriber(), topic, qos, ear);
    dds_delete_listener(ear);
    if (listener) return;
    const dds_entity_t waitset = dds_create_waitset(dds_.participant());
    dds_waitset_attach(waitset, dds_create_readcondition(reader_, DDS_ANY_STATE), 0);
    thread_ = std::thread([this, waitset] {
      while (!stop_) {
        dds_attach_t which[1];
        if (dds_waitset_wait(waitset, which, 1, DDS_MSECS(100)) > 0) take_all(reader_);
      }
    });
  }
  ~Ear() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  Ear(const Ear&) = delete;

 private:
  void take_all(dds_entity_t reader) {
    void* samples[1] = {nullptr};
    dds_sample_info_t info[1];
    while (dds_take(reader, samples, info, 1, 1) == 1) {
      const std::int64_t now = monotonic_ns();
      if (info[0].valid_data) heard_(*static_cast<const booth_msg_Skeleton*>(samples[0]), now);
      (void)dds_return_loan(reader, samples, 1);
      samples[0] = nullptr;
    }
  }

  daemon::DdsParticipant dds_;
  Heard heard_;
  dds_entity_t reader_ = 0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

daemon::DdsAnswer no(daemon::DdsCommand) { return {}; }

daemon::FrameRecord typical_frame() {
  daemon::FrameRecord frame;
  frame.shape_count = kShape;
  frame.person = daemon::PersonState::tracked;
  return frame;
}

/// The other process: a booth that answers each skeleton at once with one of its own.
void answer_until_end(daemon::DdsSettings settings, bool listener, Board& board) {
  drivers::SystemClock clock;
  settings.booth = "pong";
  daemon::DdsLink link(settings, clock, no);
  settings.booth = "ping";
  daemon::FrameRecord frame = typical_frame();
  const Ear ear(settings, listener, [&](const booth_msg_Skeleton& s, std::int64_t now) {
    frame.captured_ns = s.publish_monotonic_ns;
    link.publish(frame);
    board.one_way.add(now - s.publish_monotonic_ns);
  });
  while (!board.end && ::getppid() != 1) std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

PingFigures figures(std::vector<std::int64_t> ns) {
  std::sort(ns.begin(), ns.end());
  const auto at = [&](double q) { return 1e-3 * static_cast<double>(ns[static_cast<std::size_t>(q * static_cast<double>(ns.size() - 1))]); };
  return {.p50_us = at(0.5), .p99_us = at(0.99), .count = static_cast<int>(ns.size())};
}

struct OurFigures {
  std::vector<PingFigures> one_way, half_trip;
};

/// Figures of what was added to `times` since `seen`.
void add_second(const Times& times, std::uint64_t& seen, std::vector<PingFigures>& out, double scale) {
  const std::uint64_t n = times.count.load(std::memory_order_acquire);
  // As with ddsperf, the first second is discovery.
  if (seen > 0 && n > seen) {
    PingFigures f = figures({times.ns.begin() + static_cast<std::ptrdiff_t>(seen), times.ns.begin() + static_cast<std::ptrdiff_t>(n)});
    f.p50_us *= scale;
    f.p99_us *= scale;
    out.push_back(f);
  }
  seen = n;
}

OurFigures our_turn(daemon::DdsSettings settings, int hertz, int seconds, bool listener) {
  void* memory = ::mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no shared memory for the reader's figures");
  Board& board = *new (memory) Board;
  const pid_t child = ::fork();
  if (child == 0) {
    answer_until_end(settings, listener, board);
    ::_exit(0);
  }
  OurFigures out;
  {
    drivers::SystemClock clock;
    settings.booth = "ping";
    daemon::DdsLink link(settings, clock, no);
    settings.booth = "pong";
    const Ear ear(settings, listener, [&](const booth_msg_Skeleton& s, std::int64_t now) { board.round_trip.add(now - s.capture_monotonic_ns); });
    const daemon::FrameRecord frame = typical_frame();
    auto next = clock.now();
    std::uint64_t seen = 0, seen_back = 0;
    const auto turns = static_cast<std::uint64_t>(seconds) * static_cast<std::uint64_t>(hertz);
    for (std::uint64_t i = 0; i < turns || (seen == 0 && i < 60 * turns); ++i) {
      link.publish(frame);
      next += std::chrono::nanoseconds(1'000'000'000 / hertz);
      clock.sleep_until(next);
      if ((i + 1) % static_cast<std::uint64_t>(hertz) != 0) continue;
      add_second(board.one_way, seen, out.one_way, 1);
      add_second(board.round_trip, seen_back, out.half_trip, 0.5);
    }
  }
  board.end = true;
  ::waitpid(child, nullptr, 0);
  ::munmap(memory, sizeof(Board));
  if (out.one_way.empty() || out.half_trip.empty()) throw std::runtime_error("the other process heard nothing");
  return out;
}

double median_of(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

/// Bytes of one skeleton on the wire without the protocol's headers, by adding up the members (XCDR1: nothing but alignment between them).
int payload_bytes() {
  constexpr int kJoint = 3 * 8 + 4 * 8 + 6 * 4 + 8;
  return 8 + 6 * 8 + 3 * 4 + 36 * 8 + 4 + static_cast<int>(kShape) * 8 + 24 * kJoint + 2 * 4 + 2 * 4 + 8 + 12;
}

struct Task {
  const char* trigger;
  int hertz, seconds, rounds;
  std::uint32_t domain;              ///< and the following ones, one a round
  const BenchIdentity* credentials;  ///< null: plain
};

void run_one(const Task& task, Report& report) {
  std::vector<double> ping50, ping99, half50, half99, one50, one99;
  const auto add = [](const std::vector<PingFigures>& from, std::vector<double>& p50, std::vector<double>& p99) {
    for (const auto& f : from) p50.push_back(f.p50_us), p99.push_back(f.p99_us);
  };
  int samples = 0;
  for (int round = 0; round < task.rounds; ++round) {
    // Domains of their own: a library configured once for a domain keeps its first configuration.
    daemon::DdsSettings settings{
        .booth = "bench", .domain = task.domain + static_cast<std::uint32_t>(round), .interface = "lo", .multicast = false, .peers = {}};
    std::string uri = daemon::dds_configuration(settings);
    if (task.credentials) {
      settings.secured = true;
      settings.identity = task.credentials->identity;
      uri = task.credentials->secured(uri);
    }
    add(ddsperf_ping(uri, static_cast<int>(settings.domain) + 50, payload_bytes(), task.hertz, task.seconds, task.trigger), ping50, ping99);
    const OurFigures ours = our_turn(settings, task.hertz, task.seconds, std::string(task.trigger) == "listener");
    add(ours.one_way, one50, one99);
    add(ours.half_trip, half50, half99);
    for (const auto& f : ours.one_way) samples += f.count;
  }
  const std::string how = task.credentials ? "secured, " : "";
  const std::string reference = fmt::format("ddsperf ping {}{}", how, task.trigger);
  const auto tell = [&](const char* what, const char* quantile, const std::vector<double>& ours, const std::vector<double>& theirs) {
    report.add({.name = fmt::format("{}, {}{}, {}", what, how, task.trigger, quantile),
                .unit = "us",
                .value = median_of(ours),
                .reference = reference,
                .reference_value = median_of(theirs)});
  };
  // ddsperf prints half of a round trip whose way back begins in a thread that is awake; half of ours is its like. The way out alone begins after a sleep.
  tell("publish to take, half a round trip", "p50", half50, ping50);
  tell("publish to take, half a round trip", "p99", half99, ping99);
  tell("publish to take, way out", "p50", one50, ping50);
  tell("publish to take, way out", "p99", one99, ping99);
  report.add({.name = fmt::format("skeletons, {}{}", how, task.trigger), .unit = "", .value = static_cast<double>(samples)});
}

void run(const Common& common, Report& report, int hertz, int rounds) {
  const BenchIdentity credentials;
  const auto base = static_cast<std::uint32_t>(100 + ::getpid() % 25);
  std::uint32_t turn = 0;
  for (const char* trigger : {"listener", "waitset"})
    for (const BenchIdentity* identity : {static_cast<const BenchIdentity*>(nullptr), &credentials})
      run_one({.trigger = trigger,
               .hertz = hertz,
               .seconds = common.short_form ? 3 : 5,
               .rounds = common.short_form ? 1 : rounds,
               // ddsperf's are fifty higher, and DDS Security knows none above 230.
               .domain = base + (turn++ % 2 != 0 ? 25u : 0u),
               .credentials = identity},
              report);
  add_mirror_cost(report, base + 40, common.short_form ? 2 : 10);
  report.note("payload", fmt::format("{} bytes", payload_bytes()));
  report.note("rate", fmt::format("{} Hz", hertz));
  report.note("secured", "ENCRYPT_WITH_ORIGIN_AUTHENTICATION for every topic, both sides with the same governance");
}

const Registration kRegistration({.name = "dds",
                                  .what = "Publish to take of a skeleton between two processes, against ddsperf's ping",
                                  .make = [](CLI::App& options) {
                                    auto hertz = std::make_shared<int>(200), rounds = std::make_shared<int>(6);
                                    options.add_option("--rate", *hertz, "Skeletons and pings a second")->check(CLI::Range(1, 5000))->capture_default_str();
                                    options.add_option("--rounds", *rounds, "Turns of each")->check(CLI::Range(1, 24))->capture_default_str();
                                    return Run([hertz, rounds](const Common& common, Report& report) { run(common, report, *hertz, *rounds); });
                                  }});

}  // namespace
}  // namespace booth::bench
