// The files with which a participant proves itself, found, read and examined before the DDS library sees them.
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/dds/dds_settings.hpp"
#include "daemon/security/certificates.hpp"
#include "daemon/security/rights.hpp"

namespace booth::daemon {

/// Names of the files of one participant, those of ROS 2's enclaves: such a folder serves a ROS 2 node as it is.
inline constexpr const char* kIdentityAuthorityFile = "identity_ca.cert.pem";
inline constexpr const char* kCertificateFile = "cert.pem";
inline constexpr const char* kKeyFile = "key.pem";
inline constexpr const char* kPermissionsAuthorityFile = "permissions_ca.cert.pem";
inline constexpr const char* kGovernanceFile = "governance.p7s";
inline constexpr const char* kPermissionsFile = "permissions.p7s";
inline constexpr const char* kRevocationsFile = "crl.pem";  ///< may be missing

/// What stands before each name where systemd delivers the files as credentials ("boothd.cert.pem").
inline constexpr const char* kSystemdPrefix = "boothd.";

/// One sentence: the file, what is wrong, what to do.
struct CredentialError : std::runtime_error {
  explicit CredentialError(const std::string& text, bool later = false) : std::runtime_error(text), may_pass(later) {}
  bool may_pass;  ///< nobody may have to mend it: the clock is not right yet, the disk is full
};

/// One file and until when it serves.
struct CredentialPart {
  std::filesystem::path file;
  std::string what, name;  ///< "certificate", "viewer.wall"
  Validity valid;
};

struct Credentials {
  std::shared_ptr<const DdsIdentity> identity;
  CertificateFacts certificate;
  PermissionFacts permissions;
  std::vector<CredentialPart> parts;
  std::vector<std::string> warnings;
  bool self_issued = false;

  /// The part that expires first.
  const CredentialPart& first_to_expire() const;
};

/// Reads and examines everything but the dates and the certificate's place on the revocation list. Throws CredentialError.
Credentials read_credentials(const std::filesystem::path& folder, const std::string& prefix = "");

/// Throws CredentialError where a part is not valid at `now` (seconds of UTC).
void check_dates(const Credentials& credentials, std::int64_t now);

/// Throws CredentialError unless these are the credentials of that participant of the fleet.
void check_identity(const Credentials& credentials, Role role, const std::string& name);

/// What a person should look after at `now`: empty as long as every part serves for more than `warn_days` days. One sentence.
std::string expiry_problem(const Credentials& credentials, std::int64_t now, std::int64_t warn_days);

/// "certificate booth.lobby until 2027-01-31", of the part that expires first; with "self-issued" where boothd made them.
std::string credentials_line(const Credentials& credentials);

}  // namespace booth::daemon
