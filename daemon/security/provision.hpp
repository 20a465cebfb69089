// Where a participant's credentials come from, in which order; and what a booth does that was given none.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/security/credentials.hpp"

namespace booth::daemon {

struct CredentialQuery {
  Role role = Role::booth;
  std::string name;                   ///< booth.id of a booth; of others empty, whoever they are
  std::filesystem::path folder;       ///< named by a person (dds.credentials, --credentials): nothing else is looked at then
  std::filesystem::path delivered;    ///< systemd's $CREDENTIALS_DIRECTORY; counts when it holds one of the files
  std::filesystem::path self_issued;  ///< a fleet of this machine alone (dds.self_issued)
  bool may_issue = false;             ///< a booth that finds none makes that fleet and credentials of its own, and renews them in time
};

/// The credentials of this query, examined: dates, revocation, whose they are. Throws CredentialError or std::runtime_error, one sentence.
Credentials obtain_credentials(const CredentialQuery& query, std::int64_t now);

/// Self-issued credentials are renewed at a start when less than so many days are left.
inline constexpr std::int64_t kRenewDays = 90;

}  // namespace booth::daemon
