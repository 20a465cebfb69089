// Domain, participant and partition, from the settings.
#include "daemon/dds/participant.hpp"

#include <dds/ddsrt/log.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <stdexcept>

#include "daemon/dds/topics.hpp"
#include "daemon/health/log.hpp"

namespace booth::daemon {
namespace {

/// The library's own complaints: whoever sends garbage would otherwise write our log. One line in ten seconds, the others are counted.
void log_of_library(void*, const dds_log_data_t* data) {
  static std::atomic<std::int64_t> next{0};
  static std::atomic<std::uint64_t> held_back{0};
  const std::int64_t now = std::chrono::steady_clock::now().time_since_epoch() / std::chrono::milliseconds(1);
  std::int64_t due = next.load();
  if (now < due || !next.compare_exchange_strong(due, now + 10'000)) {
    held_back.fetch_add(1);
    return;
  }
  std::string text(data->message, std::min<std::size_t>(data->size, 200));
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  const std::uint64_t others = held_back.exchange(0);
  log_line(LogLevel::warning, fmt::format("DDS: {}{}", text, others ? fmt::format(" ({} more lines before this one)", others) : ""));
}

bool is_address(const std::string& text) { return text.find_first_not_of("0123456789.") == std::string::npos || text.find(':') != std::string::npos; }

}  // namespace

void set_identity(const DdsQos& qos, const DdsIdentity& identity) {
  const auto set = [&](const char* name, const std::string& value) { dds_qset_prop(qos, name, value.c_str()); };
  struct Plugin {
    const char *part, *library, *name;
  };
  for (const Plugin p : {Plugin{"auth", "dds_security_auth", "authentication"}, Plugin{"crypto", "dds_security_crypto", "crypto"},
                         Plugin{"access", "dds_security_ac", "access_control"}}) {
    set(fmt::format("dds.sec.{}.library.path", p.part).c_str(), p.library);
    set(fmt::format("dds.sec.{}.library.init", p.part).c_str(), fmt::format("init_{}", p.name));
    set(fmt::format("dds.sec.{}.library.finalize", p.part).c_str(), fmt::format("finalize_{}", p.name));
  }
  // As data and not as files: what was examined is what is used, whatever becomes of the files.
  set("dds.sec.auth.identity_ca", "data:," + identity.identity_ca);
  set("dds.sec.auth.identity_certificate", "data:," + identity.certificate);
  set("dds.sec.auth.private_key", "data:," + identity.private_key);
  set("dds.sec.access.permissions_ca", "data:," + identity.permissions_ca);
  set("dds.sec.access.governance", "data:," + identity.governance);
  set("dds.sec.access.permissions", "data:," + identity.permissions);
  if (!identity.revocations.empty()) set("org.eclipse.cyclonedds.sec.auth.crl", "file:" + identity.revocations);
}

dds_entity_t dds_check(dds_entity_t entity, const std::string& what) {
  if (entity == DDS_RETCODE_NOT_ALLOWED_BY_SECURITY)
    throw std::runtime_error(fmt::format("DDS: these credentials do not permit {}; `boothctl security show FOLDER` says what they do", what));
  if (entity < 0)
    throw std::runtime_error(
        fmt::format("DDS: {} failed: {} (keys dds.domain, dds.interface, dds.multicast, dds.peers; or dds.enabled=false)", what, dds_strretcode(-entity)));
  return entity;
}

std::string dds_configuration(const DdsSettings& settings) {
  std::string interfaces;
  if (!settings.interface.empty())
    interfaces = fmt::format("<Interfaces><NetworkInterface {}=\"{}\"/></Interfaces>", is_address(settings.interface) ? "address" : "name", settings.interface);
  std::string peers;
  if (!settings.multicast) peers += "<Peer Address=\"localhost\"/>";
  for (const auto& peer : settings.peers) peers += fmt::format("<Peer Address=\"{}\"/>", peer);
  if (!peers.empty()) peers = "<Peers>" + peers + "</Peers>";
  // Watermarks: by default the library makes a reliable writer wait for slow readers, the sooner the more is lost on the way; here histories are bounded by
  // keep last instead, and their 1000 samples of 300 bytes stay below this mark.
  // Without multicast participants are found at ports counted from zero; 32 of them on one machine are enough for any booth.
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\"><General>{}<AllowMulticast>{}</AllowMulticast></General>"
      "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>{}</Discovery>"
      "<Internal><Watermarks><WhcAdaptive>false</WhcAdaptive><WhcHigh>4 MiB</WhcHigh></Watermarks></Internal></Domain></CycloneDDS>",
      interfaces, settings.multicast ? "true" : "false", peers);
}

DdsParticipant::DdsParticipant(const DdsSettings& settings) {
  static std::once_flag once;
  std::call_once(once, [] { dds_set_log_sink(log_of_library, nullptr); });
  try {
    domain_ = dds_create_domain(settings.domain, dds_configuration(settings).c_str());
    // Another part of this process may have opened the domain already (tests do); its configuration then holds.
    if (domain_ < 0 && domain_ != DDS_RETCODE_PRECONDITION_NOT_MET) dds_check(domain_, "opening the domain");
    DdsQos participant_qos;  // what identifies this participant to others is set here and nowhere else
    if (settings.secured && !settings.identity) throw std::runtime_error("DDS: dds.security is \"on\", and this part of the program has no credentials");
    if (settings.secured) set_identity(participant_qos, *settings.identity);
    participant_ = dds_check(dds_create_participant(settings.domain, participant_qos, nullptr),
                             settings.secured ? "joining the domain with these credentials (dds.security)" : "joining the domain");
    DdsQos partition;
    std::vector<const char*> names;
    for (const auto& name : settings.partitions) names.push_back(name.c_str());
    if (names.empty()) names.push_back(settings.booth.c_str());
    dds_qset_partition(partition, static_cast<std::uint32_t>(names.size()), names.data());
    publisher_ = dds_check(dds_create_publisher(participant_, partition, nullptr), "making a publisher");
    subscriber_ = dds_check(dds_create_subscriber(participant_, partition, nullptr), "making a subscriber");
  } catch (...) {
    close();
    throw;
  }
}

DdsParticipant::~DdsParticipant() { close(); }

void DdsParticipant::close() {
  if (participant_ > 0) dds_delete(participant_);
  if (domain_ > 0) dds_delete(domain_);
}

}  // namespace booth::daemon
