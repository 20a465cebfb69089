// booth-bench dds: our publish to take in another process, and ddsperf's ping of the same payload, in turns in one run.
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
#include <memory>
#include <stdexcept>
#include <thread>

#include "booth.h"
#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/bench/dds/ddsperf.hpp"
#include "tests/bench/harness/harness.hpp"

namespace booth::bench {
namespace {

using daemon::DdsTopic;

constexpr std::size_t kMost = 100'000;
constexpr std::uint32_t kShape = 20;

/// Shared by publisher and reader, which are two processes.
struct Board {
  std::atomic<std::uint64_t> count{0};
  std::atomic<bool> ready{false}, end{false};
  std::array<std::int64_t, kMost> ns{};
};

std::int64_t monotonic_ns() {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::int64_t>(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

void take_all(dds_entity_t reader, Board& board) {
  void* samples[1] = {nullptr};
  dds_sample_info_t info[1];
  while (dds_take(reader, samples, info, 1, 1) == 1) {
    const std::int64_t now = monotonic_ns();
    const std::uint64_t n = board.count.load(std::memory_order_relaxed);
    if (info[0].valid_data && n < kMost) {
      board.ns[n] = now - static_cast<const booth_msg_Skeleton*>(samples[0])->publish_monotonic_ns;
      board.count.store(n + 1, std::memory_order_release);
    }
    (void)dds_return_loan(reader, samples, 1);
    samples[0] = nullptr;
  }
}

/// The reader's process: as ddsperf does it, in the library's receiving thread (listener) or in a thread of its own (waitset).
int read_until_end(const daemon::DdsSettings& settings, bool listener, Board& board) {
  const daemon::DdsParticipant dds(settings);
  const daemon::DdsQos qos;
  daemon::set_topic_qos(DdsTopic::skeleton, qos);
  const dds_entity_t topic = dds_create_topic(dds.participant(), &booth_msg_Skeleton_desc, "booth/skeleton", nullptr, nullptr);
  dds_listener_t* ear = dds_create_listener(&board);
  if (listener) dds_lset_data_available(ear, [](dds_entity_t reader, void* arg) { take_all(reader, *static_cast<Board*>(arg)); });
  const dds_entity_t reader = dds_create_reader(dds.subscriber(), topic, qos, ear);
  const dds_entity_t waitset = dds_create_waitset(dds.participant());
  if (!listener) dds_waitset_attach(waitset, dds_create_readcondition(reader, DDS_ANY_STATE), 0);
  board.ready = true;
  while (!board.end) {
    dds_attach_t which[1];
    if (listener)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    else if (dds_waitset_wait(waitset, which, 1, DDS_MSECS(100)) > 0)
      take_all(reader, board);
  }
  dds_delete_listener(ear);
  return 0;
}

PingFigures figures(std::vector<std::int64_t> ns) {
  std::sort(ns.begin(), ns.end());
  const auto at = [&](double q) { return 1e-3 * static_cast<double>(ns[static_cast<std::size_t>(q * static_cast<double>(ns.size() - 1))]); };
  return {.p50_us = at(0.5), .p99_us = at(0.99), .count = static_cast<int>(ns.size())};
}

std::vector<PingFigures> our_turn(const daemon::DdsSettings& settings, int hertz, int seconds, bool listener) {
  void* memory = ::mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no shared memory for the reader's figures");
  Board& board = *new (memory) Board;
  const pid_t child = ::fork();
  if (child == 0) ::_exit(read_until_end(settings, listener, board));
  std::vector<PingFigures> out;
  {
    drivers::SystemClock clock;
    daemon::DdsLink link(settings, clock, [](daemon::DdsCommand) { return daemon::DdsAnswer{}; });
    daemon::FrameRecord frame;
    frame.shape_count = kShape;
    frame.person = daemon::PersonState::tracked;
    auto next = clock.now();
    std::uint64_t seen = 0;
    const auto turns = static_cast<std::uint64_t>(seconds) * static_cast<std::uint64_t>(hertz);
    for (std::uint64_t i = 0, second = 1; i < turns || (seen == 0 && i < 60 * turns); ++i) {
      link.publish(frame);
      next += std::chrono::nanoseconds(1'000'000'000 / hertz);
      clock.sleep_until(next);
      if (i + 1 < second * static_cast<std::uint64_t>(hertz)) continue;
      ++second;
      const std::uint64_t n = board.count.load(std::memory_order_acquire);
      // As with ddsperf, the first second is discovery.
      if (seen > 0 && n > seen)
        out.push_back(figures({board.ns.begin() + static_cast<std::ptrdiff_t>(seen), board.ns.begin() + static_cast<std::ptrdiff_t>(n)}));
      seen = n;
    }
  }
  board.end = true;
  ::waitpid(child, nullptr, 0);
  ::munmap(memory, sizeof(Board));
  if (out.empty()) throw std::runtime_error("the reader heard nothing");
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

void run(const Common& common, Report& report, int hertz, int rounds) {
  const int seconds = common.short_form ? 3 : 5;
  const auto base = static_cast<std::uint32_t>(100 + ::getpid() % 50);
  for (const char* trigger : {"listener", "waitset"}) {
    std::vector<double> ours50, ours99, theirs50, theirs99;
    int samples = 0;
    for (int round = 0; round < (common.short_form ? 1 : rounds); ++round) {
      // Domains of their own: a library configured once for a domain keeps its first configuration.
      const daemon::DdsSettings settings{
          .booth = "bench", .domain = base + static_cast<std::uint32_t>(round), .interface = "lo", .multicast = false, .peers = {}};
      for (const auto& f : ddsperf_ping(daemon::dds_configuration(settings), static_cast<int>(settings.domain) + 50, payload_bytes(), hertz, seconds, trigger))
        theirs50.push_back(f.p50_us), theirs99.push_back(f.p99_us);
      for (const auto& f : our_turn(settings, hertz, seconds, std::string(trigger) == "listener"))
        ours50.push_back(f.p50_us), ours99.push_back(f.p99_us), samples += f.count;
    }
    const std::string reference = fmt::format("ddsperf ping {}", trigger);
    report.add({.name = fmt::format("publish to take, {}, p50", trigger),
                .unit = "us",
                .value = median_of(ours50),
                .reference = reference,
                .reference_value = median_of(theirs50)});
    report.add({.name = fmt::format("publish to take, {}, p99", trigger),
                .unit = "us",
                .value = median_of(ours99),
                .reference = reference,
                .reference_value = median_of(theirs99)});
    report.add({.name = fmt::format("skeletons, {}", trigger), .unit = "", .value = static_cast<double>(samples)});
  }
  report.note("payload", fmt::format("{} bytes", payload_bytes()));
  report.note("rate", fmt::format("{} Hz", hertz));
  report.note("security", "off");
}

const Registration kRegistration({.name = "dds",
                                  .what = "Publish to take of a skeleton between two processes, against ddsperf's ping",
                                  .make = [](CLI::App& options) {
                                    auto hertz = std::make_shared<int>(200), rounds = std::make_shared<int>(6);
                                    options.add_option("--rate", *hertz, "Skeletons and pings a second")->check(CLI::Range(1, 5000))->capture_default_str();
                                    options.add_option("--rounds", *rounds, "Turns of each")->check(CLI::Range(1, 50))->capture_default_str();
                                    return Run([hertz, rounds](const Common& common, Report& report) { run(common, report, *hertz, *rounds); });
                                  }});

}  // namespace
}  // namespace booth::bench
