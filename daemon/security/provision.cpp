// Named, delivered, self-issued; nothing is ever mixed.
#include "daemon/security/provision.hpp"

#include <fmt/format.h>

#include <array>

#include "daemon/security/fleet_folder.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

/// Earlier than this program: a clock that was never set. What is dated by it would be wrong for ever.
constexpr std::int64_t kImpossiblyEarly = 1'760'000'000;  // October 2025

bool holds_credentials(const fs::path& folder) {
  if (folder.empty()) return false;
  std::error_code error;
  for (const char* name : {kCertificateFile, kKeyFile, kIdentityAuthorityFile, kPermissionsAuthorityFile, kGovernanceFile, kPermissionsFile})
    if (fs::exists(folder / (std::string(kSystemdPrefix) + name), error)) return true;
  return false;
}

void issue_to_ourselves(const fs::path& fleet, const std::string& booth, std::int64_t now) {
  if (now < kImpossiblyEarly)
    throw CredentialError(fmt::format("this machine's clock says {}: no credentials can be made before it is set", utc_text(now)), true);
  std::error_code error;
  if (!fs::exists(fleet, error) || fs::is_empty(fleet, error)) make_fleet(fleet, "local", kAuthorityDays, now);
  for (const IssueOrder& order :
       {IssueOrder{.role = Role::booth, .name = booth, .booths = {}}, IssueOrder{.role = Role::viewer, .name = "local", .booths = {"*"}},
        IssueOrder{.role = Role::console, .name = "local", .booths = {"*"}}}) {
    const fs::path place = fleet / kIssuedFolder / identity_name(order.role, order.name);
    if (!fs::exists(place, error)) {
      issue(fleet, order, now);
      continue;
    }
    const Credentials old = read_credentials(place);
    // What a person has issued here stays as it is; so does everything once the authorities themselves end.
    const Validity authority = read_certificate(old.identity->identity_ca).valid;
    // Made while the clock was ahead of the time: until then nobody would accept them.
    const bool too_early = old.certificate.valid.from > now && authority.from <= now;
    if (!too_early && (old.first_to_expire().valid.until > now + kRenewDays * kSecondsOfDay || authority.until <= now + kRenewDays * kSecondsOfDay)) continue;
    IssueOrder again = order;
    again.renew = true;
    issue(fleet, again, now);
  }
}

Credentials examined(Credentials found, const CredentialQuery& query, std::int64_t now) {
  if (query.role == Role::booth) check_identity(found, query.role, query.name);
  check_dates(found, now);
  return found;
}

}  // namespace

Credentials obtain_credentials(const CredentialQuery& query, std::int64_t now) {
  if (!query.folder.empty()) return examined(read_credentials(query.folder), query, now);
  if (holds_credentials(query.delivered)) return examined(read_credentials(query.delivered, kSystemdPrefix), query, now);
  const std::string who = query.role == Role::booth ? query.name : "local";
  const fs::path place = query.self_issued / kIssuedFolder / identity_name(query.role, who);
  std::string not_renewed;
  if (query.may_issue) {
    try {
      issue_to_ourselves(query.self_issued, query.name, now);
    } catch (const CredentialError&) {
      throw;
    } catch (const std::exception& e) {
      // What a full disk keeps from being renewed serves on; what it keeps from being made can be made when there is room.
      std::error_code ignored;
      if (!fs::exists(place, ignored))
        throw CredentialError(fmt::format("no DDS credentials were given (dds.credentials), and none can be made: {}", e.what()), true);
      not_renewed = fmt::format("{} cannot be renewed: {}", place.string(), e.what());
    }
  }
  std::error_code error;
  if (!fs::exists(place, error) || error)
    throw CredentialError(fmt::format(
        "dds.security is \"on\", and there are no credentials: {} {}; name a folder from `boothctl security issue` by dds.credentials or --credentials",
        place.string(), error ? "cannot be looked at (" + error.message() + ")" : "does not exist"));
  Credentials out = read_credentials(place);
  out.self_issued = true;
  if (!not_renewed.empty()) out.warnings.push_back(not_renewed);
  return examined(std::move(out), query, now);
}

}  // namespace booth::daemon
