// A fleet's secrets on the operator's machine: two authorities, the rules of the domain, and a folder for each participant that was issued.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/security/rights.hpp"

namespace booth::daemon {

/// Of a fleet's folder. The authorities are two, because their keys have different work: that of identities renews certificates, often and perhaps by a
/// script, and whoever steals it can pretend to be a participant; that of permissions says who may do what, seldom, and can be kept elsewhere.
inline constexpr const char* kIdentityAuthorityKeyFile = "identity_ca.key.pem";
inline constexpr const char* kPermissionsAuthorityKeyFile = "permissions_ca.key.pem";
inline constexpr const char* kIssuedFolder = "issued";

inline constexpr std::int64_t kAuthorityDays = 3650, kIdentityDays = 398;

struct IssueOrder {
  Role role = Role::viewer;
  std::string name;                 ///< of the participant; of a booth its booth.id
  std::vector<std::string> booths;  ///< whom a viewer or console may hear or command, "*" for all; ignored for a booth
  std::int64_t days = kIdentityDays;
  bool renew = false;  ///< replaces what was issued under this name
};

/// Everything is written beside its place first and then renamed there, private keys with mode 0600 and folders with 0700; nothing that exists is
/// overwritten. All throw std::runtime_error: the thing, the place, the remedy. `now`: seconds of UTC.

/// `folder` must not exist, or be empty. `name` appears in the authorities' certificates.
void make_fleet(const std::filesystem::path& folder, const std::string& name, std::int64_t days, std::int64_t now);

/// Returns the folder with the participant's files, FOLDER/issued/ROLE.NAME.
std::filesystem::path issue(const std::filesystem::path& folder, const IssueOrder& order, std::int64_t now);

/// Takes certificates back before they expire: adds the serial numbers to FOLDER/crl.pem, which every participant has to be given.
void revoke(const std::filesystem::path& folder, const std::vector<std::string>& serials, std::int64_t now);

/// Empty, or what is wrong with the name of a participant or fleet.
std::string name_objection(const std::string& name);

}  // namespace booth::daemon
