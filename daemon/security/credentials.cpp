// Seven files, each checked against its neighbours.
#include "daemon/security/credentials.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>

#include "daemon/io/file_bytes.hpp"
#include "daemon/security/signed_document.hpp"

namespace booth::daemon {
namespace {

constexpr std::uint64_t kMostBytes = 1 << 20;
constexpr const char* kRemedy = "issue credentials anew with `boothctl security issue`";

/// Runs a check of one file's contents; what it throws becomes a sentence about the file.
template <class F>
auto of_file(const std::filesystem::path& file, F check) {
  try {
    return check();
  } catch (const CredentialError&) {
    throw;
  } catch (const std::exception& e) {
    throw CredentialError(fmt::format("{}: {}; {}", file.string(), e.what(), kRemedy));
  }
}

void object(const std::filesystem::path& file, const std::string& objection) {
  if (!objection.empty()) throw CredentialError(fmt::format("{}: {}; {}", file.string(), objection, kRemedy));
}

class Reader {
 public:
  Reader(std::filesystem::path folder, std::string prefix) : folder_(std::move(folder)), prefix_(std::move(prefix)) {}
  std::filesystem::path path(const char* name) const { return folder_ / (prefix_ + name); }
  std::string text(const char* name) const {
    try {
      return read_file_bytes(path(name), kMostBytes);
    } catch (const std::exception& e) {
      throw CredentialError(fmt::format("DDS credentials: {}", e.what()));
    }
  }
  bool has(const char* name) const {
    std::error_code error;
    return std::filesystem::exists(path(name), error);
  }

 private:
  std::filesystem::path folder_;
  std::string prefix_;
};

/// systemd keeps its own copies readable for the service alone, by means that the mode does not show.
void check_mode(const std::filesystem::path& key, bool delivered) {
  struct stat file {};
  if (delivered || ::stat(key.c_str(), &file) != 0) return;
  if ((file.st_mode & 0077) != 0)
    throw CredentialError(
        fmt::format("{}: others than its owner may read or write this private key (mode {:04o}); chmod 600 it, and issue a new one if it was seen",
                    key.string(), file.st_mode & 07777));
}

}  // namespace

const CredentialPart& Credentials::first_to_expire() const {
  return *std::min_element(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.valid.until < b.valid.until; });
}

Credentials read_credentials(const std::filesystem::path& folder, const std::string& prefix) {
  const Reader files(folder, prefix);
  DdsIdentity pem{.identity_ca = files.text(kIdentityAuthorityFile),
                  .certificate = files.text(kCertificateFile),
                  .private_key = files.text(kKeyFile),
                  .permissions_ca = files.text(kPermissionsAuthorityFile),
                  .governance = files.text(kGovernanceFile),
                  .permissions = files.text(kPermissionsFile),
                  .revocations = files.has(kRevocationsFile) ? files.path(kRevocationsFile).string() : ""};
  check_mode(files.path(kKeyFile), !prefix.empty());

  Credentials out;
  const auto certificate = [&](const char* file, const std::string& text, const char* what) {
    CertificateFacts facts = of_file(files.path(file), [&] { return read_certificate(text); });
    out.parts.push_back({files.path(file), what, facts.name, facts.valid});
    return facts;
  };
  out.certificate = certificate(kCertificateFile, pem.certificate, "certificate");
  if (!certificate(kIdentityAuthorityFile, pem.identity_ca, "identity authority").authority)
    object(files.path(kIdentityAuthorityFile), "is not the certificate of an authority");
  certificate(kPermissionsAuthorityFile, pem.permissions_ca, "permissions authority");
  object(files.path(kKeyFile), of_file(files.path(kKeyFile), [&] { return pair_objection(pem.certificate, pem.private_key); }));
  object(files.path(kCertificateFile), of_file(files.path(kCertificateFile), [&] { return issuer_objection(pem.certificate, pem.identity_ca); }));

  out.permissions = of_file(files.path(kPermissionsFile), [&] { return read_permissions(open_document(pem.permissions, pem.permissions_ca)); });
  out.parts.push_back({files.path(kPermissionsFile), "permissions", out.permissions.subject, out.permissions.valid});
  if (out.permissions.subject != "CN=" + out.certificate.name)
    object(files.path(kPermissionsFile), fmt::format("is for {}, not for the certificate beside it (CN={})", out.permissions.subject, out.certificate.name));
  const std::string governance = of_file(files.path(kGovernanceFile), [&] { return open_document(pem.governance, pem.permissions_ca); });
  for (const auto& weakness : governance_weaknesses(governance)) out.warnings.push_back(fmt::format("{}: {}", files.path(kGovernanceFile).string(), weakness));
  if (!out.permissions.denies_the_rest) out.warnings.push_back(fmt::format("{}: allows what it does not name", files.path(kPermissionsFile).string()));
  if (!pem.revocations.empty()) {
    const auto revoked = of_file(pem.revocations, [&] { return read_revocations(files.text(kRevocationsFile), pem.identity_ca); });
    if (std::find(revoked.begin(), revoked.end(), out.certificate.serial) != revoked.end())
      throw CredentialError(fmt::format("{}: the certificate {} has been revoked ({}); {}", files.path(kCertificateFile).string(), out.certificate.name,
                                        pem.revocations, kRemedy));
  }
  out.identity = std::make_shared<const DdsIdentity>(std::move(pem));
  return out;
}

void check_dates(const Credentials& credentials, std::int64_t now) {
  for (const auto& part : credentials.parts) {
    if (now < part.valid.from)
      throw CredentialError(fmt::format("{}: the {} {} is valid from {}, and this machine's clock says {}; set the clock", part.file.string(), part.what,
                                        part.name, utc_text(part.valid.from), utc_text(now)),
                            true);
    if (now > part.valid.until)
      throw CredentialError(fmt::format("{}: the {} {} expired at {}, and this machine's clock says {}; {}", part.file.string(), part.what, part.name,
                                        utc_text(part.valid.until), utc_text(now), kRemedy),
                            true);  // a clock that leapt ahead is put right some day
  }
}

void check_identity(const Credentials& credentials, Role role, const std::string& name) {
  const auto who = parse_identity_name(credentials.certificate.name);
  if (who && who->role == role && (name.empty() || who->name == name)) return;
  const auto file = credentials.parts.front().file.string();
  throw CredentialError(fmt::format("{}: is the certificate of {}, and {} is needed here; {}", file, credentials.certificate.name,
                                    name.empty() ? fmt::format("that of a {}", role_name(role)) : identity_name(role, name), kRemedy));
}

std::string expiry_problem(const Credentials& credentials, std::int64_t now, std::int64_t warn_days) {
  const CredentialPart& part = credentials.first_to_expire();
  const std::int64_t left = part.valid.until - now;
  if (left > warn_days * kSecondsOfDay) return "";
  // Short, because the sentence has to fit into a status on DDS.
  if (left < 0)
    return fmt::format("DDS: the {} {} expired on {}: nobody hears this booth; issue a new one and restart boothd", part.what, part.name,
                       utc_day(part.valid.until));
  return fmt::format("DDS: the {} {} expires in {} day{} ({}); issue a new one and restart boothd", part.what, part.name, left / kSecondsOfDay,
                     left / kSecondsOfDay == 1 ? "" : "s", utc_day(part.valid.until));
}

std::string credentials_line(const Credentials& credentials) {
  const CredentialPart& part = credentials.first_to_expire();
  return fmt::format("{}{}, until {}", credentials.self_issued ? "self-issued, " : "", credentials.certificate.name, utc_day(part.valid.until));
}

}  // namespace booth::daemon
