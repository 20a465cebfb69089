// What `boothctl security show` says of a fleet's folder or of one participant's credentials.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/security/credentials.hpp"

namespace booth::daemon {

/// One participant: its credentials, or why they are none.
struct SecurityRow {
  std::filesystem::path folder;
  Credentials credentials;  ///< empty where there is a problem that hides them
  std::string problem;      ///< one sentence; empty when all is well
  bool readable = false;
};

struct SecurityReport {
  std::filesystem::path folder;
  std::vector<CredentialPart> authorities;  ///< of a fleet's folder
  std::vector<SecurityRow> rows;
  std::vector<std::string> warnings;
};

/// Looks at credentials or at a fleet. `warn_days`: what expires within so many days is a warning. Throws std::runtime_error where the folder is neither.
SecurityReport look_at_credentials(const std::filesystem::path& folder, std::int64_t now, std::int64_t warn_days, const std::string& prefix = "");

std::string security_text(const SecurityReport& report, std::int64_t now);
std::string security_json(const SecurityReport& report, std::int64_t now);
/// Problems and warnings together.
int security_complaints(const SecurityReport& report);

}  // namespace booth::daemon
