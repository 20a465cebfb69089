// A fleet in a temporary folder, and credentials that no honest operator would issue.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/security/credentials.hpp"
#include "daemon/security/fleet_folder.hpp"
#include "daemon/security/signed_document.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {

/// What goes into one participant's folder; the defaults are those of an honest viewer of booth lobby.
struct Craft {
  daemon::PemPair identities, permissions;
  std::string name = "viewer.crafted";
  std::vector<daemon::TopicRule> rules = daemon::rules_for(daemon::Role::viewer, {"lobby"});
  daemon::Validity certificate, document;
};

struct TestFleet {
  static constexpr std::int64_t kAge = 20 * daemon::kSecondsOfDay;  ///< made so long ago

  explicit TestFleet(const std::string& name = "fleet") : path(folder.path / name), now(daemon::utc_seconds()) {
    daemon::make_fleet(path, name, daemon::kAuthorityDays, now - kAge);
  }
  daemon::PemPair identities() const { return pair(daemon::kIdentityAuthorityFile, daemon::kIdentityAuthorityKeyFile); }
  daemon::PemPair permissions() const { return pair(daemon::kPermissionsAuthorityFile, daemon::kPermissionsAuthorityKeyFile); }

  /// Issued long ago and valid still.
  std::string booth(const std::string& name) const {
    return daemon::issue(path, {.role = daemon::Role::booth, .name = name, .booths = {}}, now - kAge).string();
  }
  std::string viewer(const std::string& name, const std::vector<std::string>& booths) const {
    return daemon::issue(path, {.role = daemon::Role::viewer, .name = name, .booths = booths}, now - kAge).string();
  }
  std::string console(const std::string& name, const std::vector<std::string>& booths) const {
    return daemon::issue(path, {.role = daemon::Role::console, .name = name, .booths = booths}, now - kAge).string();
  }

  Craft honest() const {
    const daemon::Validity valid{now - kAge, now + 100 * daemon::kSecondsOfDay};
    return {.identities = identities(), .permissions = permissions(), .certificate = valid, .document = valid};
  }
  std::string write(const Craft& craft, const std::string& folder_name) const {
    const auto place = folder.path / folder_name;
    std::filesystem::create_directories(place);
    const auto put = [&](const char* file, const std::string& text) { daemon::write_file_atomically(place / file, text, 0600); };
    const daemon::PemPair pair = daemon::issue_certificate(craft.identities, craft.name, craft.certificate);
    put(daemon::kCertificateFile, pair.certificate);
    put(daemon::kKeyFile, pair.key);
    put(daemon::kIdentityAuthorityFile, craft.identities.certificate);
    put(daemon::kPermissionsAuthorityFile, craft.permissions.certificate);
    put(daemon::kGovernanceFile, daemon::sign_document(daemon::governance_xml(), craft.permissions));
    put(daemon::kPermissionsFile, daemon::sign_document(daemon::permissions_xml(craft.name, craft.rules, craft.document), craft.permissions));
    return place.string();
  }

  TemporaryFolder folder;
  std::filesystem::path path;
  std::int64_t now;

 private:
  daemon::PemPair pair(const char* certificate, const char* key) const {
    return {daemon::read_file_bytes(path / certificate, 1 << 20), daemon::read_file_bytes(path / key, 1 << 20)};
  }
};

}  // namespace booth::tests
