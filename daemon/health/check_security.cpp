// The credentials with which boothd proves itself on DDS: whether they are there, whose they are, until when, and who else can read them.
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>

#include "daemon/health/checks.hpp"
#include "daemon/security/credentials.hpp"
#include "daemon/security/fleet_folder.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
constexpr const char* kGroup = "dds";
constexpr const char* kName = "credentials";

enum class Source : std::uint8_t { named, delivered, self_issued };

struct Place {
  fs::path folder;
  Source source = Source::self_issued;
};

/// In boothd's own order: what the configuration names, what systemd delivers, what boothd makes for itself.
Place place_of(const DoctorInputs& in) {
  const auto& dds = in.config.dds;
  if (!dds.credentials.empty()) return {dds.credentials, Source::named};
  std::error_code error;
  const fs::path delivered = in.root / "etc/boothd/credentials";
  if (fs::exists(delivered / kCertificateFile, error) || error == std::errc::permission_denied) return {delivered, Source::delivered};
  return {fs::path(dds.self_issued) / kIssuedFolder / identity_name(Role::booth, in.config.booth.id), Source::self_issued};
}

/// Whether a drop-in of the unit asks systemd for the files.
bool is_asked_for(const fs::path& root) {
  std::error_code error;
  for (const char* folder : {"etc/systemd/system/boothd.service.d", "usr/lib/systemd/system/boothd.service.d", "lib/systemd/system/boothd.service.d"})
    for (fs::directory_iterator it(root / folder, error), end; !error && it != end; it.increment(error)) {
      std::ifstream in(it->path());
      for (std::string line; it->path().extension() == ".conf" && std::getline(in, line);)
        if (line.find(std::string("LoadCredential=") + kSystemdPrefix) != std::string::npos) return true;
    }
  return false;
}

bool is_forbidden(const fs::path& file) { return ::access(file.c_str(), R_OK) != 0 && errno == EACCES; }

Checks look_at(const Place& place, const DoctorInputs& in) {
  const std::int64_t now = utc_seconds();
  Checks out;
  try {
    Credentials found = read_credentials(place.folder);
    found.self_issued = place.source == Source::self_issued;
    check_identity(found, Role::booth, in.config.booth.id);
    check_dates(found, now);
    const std::string expiry = expiry_problem(found, now, in.config.dds.expiry_warning_days);
    if (expiry.empty())
      out.push_back({kGroup, kName, CheckResult::ok, credentials_line(found)});
    else
      out.push_back(
          {kGroup, kName, CheckResult::warning, expiry,
           found.self_issued ? "systemctl restart boothd: it renews what it issued to itself" : "boothctl security issue ... --renew, where the fleet is"});
    for (const auto& warning : found.warnings)
      out.push_back({kGroup, "protection", CheckResult::warning, warning, "issue credentials anew with `boothctl security issue`"});
  } catch (const CredentialError& e) {
    out.push_back({kGroup, kName, CheckResult::error, e.what(),
                   e.may_pass ? "boothd does not start like this, and tries again until the clock is right"
                              : "boothd will not start like this (docs/guide/security.md)"});
  }
  return out;
}

}  // namespace

Checks check_security(const DoctorInputs& in) {
  if (!in.config.dds.enabled) return {{kGroup, kName, CheckResult::skipped, "dds.enabled is false"}};
  if (in.config.dds.security != "on")
    return {{kGroup, kName, CheckResult::skipped, "dds.security is \"off\": whoever reaches this network hears and commands the booth"}};
  const Place place = place_of(in);
  if (is_forbidden(place.folder / kCertificateFile) || is_forbidden(place.folder / kKeyFile))
    return {{kGroup, kName, CheckResult::skipped, fmt::format("{} cannot be read by this user; run doctor as root", place.folder.string())}};
  std::error_code error;
  if (place.source == Source::self_issued && !fs::exists(place.folder, error))
    return {{kGroup, kName, CheckResult::ok, fmt::format("none were given; boothd makes its own in {} when it starts", in.config.dds.self_issued)}};
  Checks out = look_at(place, in);
  if (place.source == Source::delivered && !is_asked_for(in.root))
    out.push_back({kGroup, "delivery", CheckResult::error,
                   fmt::format("{} holds credentials, and no drop-in of boothd.service asks for them", place.folder.string()),
                   "copy dds-security.conf from /usr/share/doc/boothd/examples/boothd.service.d to /etc/systemd/system/boothd.service.d"});
  return out;
}

}  // namespace booth::daemon
