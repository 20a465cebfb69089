// A participant of a secured domain as a program: a booth, or somebody who would like to hear or command it, honestly or not. It checks nothing of its own:
// what stops it is the library, here or at the other end.
#include <dds/dds.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <string>
#include <thread>

#include "booth.h"
#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/security/credentials.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/peer.hpp"

namespace {

std::int64_t clock_back = 0;  ///< seconds by which this program's wall clock is wrong
volatile std::sig_atomic_t ended = 0;

}  // namespace

// Whoever holds an expired certificate may set the clock back: the libraries of this process get the time from here.
extern "C" {
int clock_gettime(clockid_t which, timespec* out) noexcept {
  const auto result = static_cast<int>(::syscall(SYS_clock_gettime, which, out));
  if (which == CLOCK_REALTIME) out->tv_sec -= clock_back;
  return result;
}
time_t time(time_t* out) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (out) *out = now.tv_sec;
  return now.tv_sec;
}
int gettimeofday(timeval* out, void*) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  *out = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}
}

namespace booth::tests {
namespace {

using daemon::DdsTopic;
using namespace std::chrono_literals;

struct Options {
  std::string action, credentials, booth, access_plugin;
  std::uint32_t domain = 0;
};

std::shared_ptr<const daemon::DdsIdentity> identity_in(const std::filesystem::path& folder) {
  const auto text = [&](const char* name) { return daemon::read_file_bytes(folder / name, 1 << 20); };
  auto out = std::make_shared<daemon::DdsIdentity>();
  *out = {.identity_ca = text(daemon::kIdentityAuthorityFile),
          .certificate = text(daemon::kCertificateFile),
          .private_key = text(daemon::kKeyFile),
          .permissions_ca = text(daemon::kPermissionsAuthorityFile),
          .governance = text(daemon::kGovernanceFile),
          .permissions = text(daemon::kPermissionsFile),
          .revocations = std::filesystem::exists(folder / daemon::kRevocationsFile) ? (folder / daemon::kRevocationsFile).string() : ""};
  return out;
}

daemon::DdsSettings settings_of(const Options& options) {
  daemon::DdsSettings out = loopback(options.booth, options.domain);
  out.secured = options.credentials != "plain";
  if (out.secured) out.identity = identity_in(options.credentials);
  return out;
}

void say(const std::string& line) { std::cout << line << std::endl; }

int be_booth(const Options& options) {
  drivers::SystemClock clock;
  daemon::DdsLink link(settings_of(options), clock, [](daemon::DdsCommand) {
    say("obeyed");
    return daemon::DdsAnswer{.accepted = true, .state = 1};
  });
  daemon::StatusSample status;
  status.software = "secured booth";
  daemon::BodySample body;
  body.session = "a session";
  link.publish(body);
  say("ready");
  for (int n = 0; !ended; ++n) {
    link.publish_idle(0);
    if (n % 10 == 0) link.publish(status);
    if (n % 10 == 0) link.publish_event("state", "test", "tick");
    std::this_thread::sleep_for(33ms);
  }
  return 0;
}

/// A participant like DdsParticipant's, but with the access plugin that the caller likes.
class Intruder {
 public:
  explicit Intruder(const Options& options) {
    const daemon::DdsSettings settings = settings_of(options);
    domain_ = daemon::dds_check(dds_create_domain(settings.domain, daemon::dds_configuration(settings).c_str()), "domain");
    const daemon::DdsQos qos;
    if (settings.secured) daemon::set_identity(qos, *settings.identity);
    if (!options.access_plugin.empty()) dds_qset_prop(qos, "dds.sec.access.library.path", options.access_plugin.c_str());
    participant = daemon::dds_check(dds_create_participant(settings.domain, qos, nullptr), "participant");
    const daemon::DdsQos partition;
    const char* names[] = {options.booth.c_str()};
    dds_qset_partition(partition, 1, names);
    publisher = daemon::dds_check(dds_create_publisher(participant, partition, nullptr), "publisher");
    subscriber = daemon::dds_check(dds_create_subscriber(participant, partition, nullptr), "subscriber");
  }
  ~Intruder() { dds_delete(domain_); }
  Intruder(const Intruder&) = delete;

  dds_entity_t participant = 0, publisher = 0, subscriber = 0;

 private:
  dds_entity_t domain_ = 0;
};

/// Says once for each topic that it was heard, and again "heard N" every hundred samples.
int listen(const Options& options) {
  const Intruder peer(options);
  std::map<std::string, dds_entity_t> readers;
  std::map<std::string, int> heard;
  for (const DdsTopic topic : {DdsTopic::skeleton, DdsTopic::body, DdsTopic::status, DdsTopic::event, DdsTopic::command, DdsTopic::reply}) {
    const std::string name = daemon::topic_info(topic).name;
    try {
      readers[name] = daemon::make_reader(peer.participant, peer.subscriber, topic);
    } catch (const std::exception&) {
      say("refused " + name);
    }
  }
  say("ready");
  for (int total = 0; !ended; std::this_thread::sleep_for(10ms))
    for (const auto& [name, reader] : readers) {
      void* samples[1] = {nullptr};
      dds_sample_info_t info[1];
      while (dds_take(reader, samples, info, 1, 1) == 1) {
        if (info[0].valid_data && heard[name]++ == 0) say("heard " + name);
        if (info[0].valid_data && ++total % 20 == 0) say("total " + std::to_string(total));
        (void)dds_return_loan(reader, samples, 1);
        samples[0] = nullptr;
      }
    }
  return 0;
}

int command(const Options& options) {
  const Intruder peer(options);
  dds_entity_t writer = 0, reader = 0;
  try {
    writer = daemon::make_writer(peer.participant, peer.publisher, DdsTopic::command);
  } catch (const std::exception&) {
    say("refused booth/command");
    return 0;
  }
  try {
    reader = daemon::make_reader(peer.participant, peer.subscriber, DdsTopic::reply);
  } catch (const std::exception&) {
    say("refused booth/reply");
  }
  say("ready");
  for (std::uint64_t id = 1; !ended; ++id) {
    const booth_msg_Command sample = tests::command("lobby", options.credentials == "plain" ? "plain" : "secured", id, booth_msg_COMMAND_START);
    (void)dds_write(writer, &sample);
    if (reader && take<booth_msg_Reply>(
                      reader, [](const booth_msg_Reply&) { say("answered"); }, 600ms))
      continue;
    std::this_thread::sleep_for(600ms);
  }
  return 0;
}

}  // namespace
}  // namespace booth::tests

int main(int argc, char** argv) {
  using namespace booth::tests;
  if (argc < 5) {
    std::cerr << "usage: booth-secure-peer booth|listen|command DOMAIN CREDENTIALS|plain PARTITION [SECONDS_BACK [ACCESS_PLUGIN]]\n";
    return 64;
  }
  Options options{.action = argv[1], .credentials = argv[3], .booth = argv[4], .access_plugin = argc > 6 ? argv[6] : "", .domain = 0};
  options.domain = static_cast<std::uint32_t>(std::atoi(argv[2]));
  if (argc > 5) clock_back = std::atoll(argv[5]);
  for (const int s : {SIGTERM, SIGINT}) std::signal(s, [](int) { ended = 1; });
  try {
    return options.action == "booth" ? be_booth(options) : options.action == "listen" ? listen(options) : command(options);
  } catch (const std::exception& e) {
    std::cout << "failed: " << e.what() << std::endl;
    return 1;
  }
}
