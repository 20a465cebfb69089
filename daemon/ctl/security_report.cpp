// Folders in, a table or JSON out.
#include "daemon/ctl/security_report.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/dds/booth_listener.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/security/fleet_folder.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

std::string left(const Validity& valid, std::int64_t now) {
  if (now > valid.until) return "EXPIRED";
  if (now < valid.from) return "not valid yet";
  return fmt::format("{} days", (valid.until - now) / kSecondsOfDay);
}

std::string joined(const std::vector<std::string>& texts) {
  std::string out;
  for (const auto& text : texts) out += (out.empty() ? "" : ", ") + printable(text);
  return out;
}

std::string rule_text(const TopicRule& rule) {
  return fmt::format("{} {} {}", rule.publish ? "writes" : "hears", joined(rule.topics),
                     rule.partitions.empty() ? "without a partition" : "of " + joined(rule.partitions));
}

SecurityRow look_at_one(const fs::path& folder, const std::string& prefix, std::int64_t now, std::int64_t warn_days) {
  SecurityRow out{.folder = folder, .credentials = {}, .problem = {}};
  try {
    out.credentials = read_credentials(folder, prefix);
    out.readable = true;
    check_dates(out.credentials, now);
  } catch (const std::exception& e) {
    out.problem = e.what();
    return out;
  }
  const CredentialPart& part = out.credentials.first_to_expire();
  if (part.valid.until - now <= warn_days * kSecondsOfDay)
    out.problem =
        fmt::format("{}: the {} expires on {}; `boothctl security issue ... --renew` makes the next", part.file.string(), part.what, utc_day(part.valid.until));
  return out;
}

/// A fleet's own secrets: keys that others can read, authorities that end.
void look_at_authorities(SecurityReport& report, std::int64_t now, std::int64_t warn_days) {
  for (const auto& [file, what] : {std::pair{kIdentityAuthorityFile, "identity authority"}, std::pair{kPermissionsAuthorityFile, "permissions authority"}}) {
    const fs::path path = report.folder / file;
    try {
      const CertificateFacts facts = read_certificate(read_file_bytes(path, 1 << 20));
      report.authorities.push_back({path, what, facts.name, facts.valid});
      if (facts.valid.until - now <= warn_days * kSecondsOfDay)
        report.warnings.push_back(fmt::format("{}: the {} {} on {}: the fleet needs a new one (`boothctl security init`)", path.string(), what,
                                              facts.valid.until < now ? "expired" : "expires", utc_day(facts.valid.until)));
    } catch (const std::exception& e) {
      report.warnings.push_back(fmt::format("{}: {}", path.string(), e.what()));
    }
  }
  for (const char* key : {kIdentityAuthorityKeyFile, kPermissionsAuthorityKeyFile}) {
    struct stat file {};
    if (::stat((report.folder / key).c_str(), &file) == 0 && (file.st_mode & 0077) != 0)
      report.warnings.push_back(fmt::format("{}: others than its owner may read or write this private key; chmod 600 it", (report.folder / key).string()));
  }
}

}  // namespace

SecurityReport look_at_credentials(const fs::path& folder, std::int64_t now, std::int64_t warn_days, const std::string& prefix) {
  SecurityReport out;
  out.folder = folder;
  std::error_code error;
  if (fs::exists(folder / (prefix + kCertificateFile), error)) {
    out.rows.push_back(look_at_one(folder, prefix, now, warn_days));
  } else if (fs::is_directory(folder / kIssuedFolder, error)) {
    look_at_authorities(out, now, warn_days);
    std::vector<fs::path> issued;
    for (fs::directory_iterator it(folder / kIssuedFolder, error), end; !error && it != end; it.increment(error))
      if (!it->path().filename().string().starts_with(".")) issued.push_back(it->path());
    if (error) throw std::runtime_error(fmt::format("{}: {}", (folder / kIssuedFolder).string(), error.message()));
    std::sort(issued.begin(), issued.end());
    for (const auto& path : issued) out.rows.push_back(look_at_one(path, "", now, warn_days));
  } else {
    throw std::runtime_error(fmt::format("{} holds neither credentials ({}) nor a fleet ({}/){}; `boothctl security init` makes a fleet", folder.string(),
                                         prefix + kCertificateFile, kIssuedFolder, error ? ": " + error.message() : ""));
  }
  for (const auto& row : out.rows) out.warnings.insert(out.warnings.end(), row.credentials.warnings.begin(), row.credentials.warnings.end());
  return out;
}

int security_complaints(const SecurityReport& report) {
  const auto bad = std::count_if(report.rows.begin(), report.rows.end(), [](const SecurityRow& row) { return !row.problem.empty(); });
  return static_cast<int>(bad) + static_cast<int>(report.warnings.size());
}

std::string security_text(const SecurityReport& report, std::int64_t now) {
  std::string out;
  for (const auto& part : report.authorities)
    out += fmt::format("{:<24} until {} ({})  {}\n", printable(part.name), utc_day(part.valid.until), left(part.valid, now), part.what);
  for (const auto& row : report.rows) {
    if (row.readable) {
      const CredentialPart& part = row.credentials.first_to_expire();
      out += fmt::format("{:<24} until {} ({})  serial {}\n", printable(row.credentials.certificate.name), utc_day(part.valid.until), left(part.valid, now),
                         row.credentials.certificate.serial);
      for (const auto& rule : row.credentials.permissions.rules) out += fmt::format("{:<24} {}\n", "", rule_text(rule));
    }
    if (!row.problem.empty()) out += "warning: " + printable(row.problem) + "\n";
  }
  if (!report.authorities.empty() && report.rows.empty()) out += "nobody has been issued credentials yet (`boothctl security issue`)\n";
  for (const auto& warning : report.warnings) out += "warning: " + printable(warning) + "\n";
  return out;
}

std::string security_json(const SecurityReport& report, std::int64_t now) {
  using Json = nlohmann::ordered_json;
  const auto part_json = [&](const CredentialPart& part) {
    return Json{{"file", part.file.string()},
                {"what", part.what},
                {"name", part.name},
                {"from", utc_text(part.valid.from)},
                {"until", utc_text(part.valid.until)},
                {"seconds_left", part.valid.until - now}};
  };
  Json j{{"folder", report.folder.string()}, {"ok", security_complaints(report) == 0}};
  j["authorities"] = Json::array();
  for (const auto& part : report.authorities) j["authorities"].push_back(part_json(part));
  j["participants"] = Json::array();
  for (const auto& row : report.rows) {
    Json one{{"folder", row.folder.string()}, {"problem", row.problem}};
    if (row.readable) {
      one["name"] = row.credentials.certificate.name;
      one["serial"] = row.credentials.certificate.serial;
      one["issuer"] = row.credentials.certificate.issuer;
      one["until"] = utc_text(row.credentials.first_to_expire().valid.until);
      one["parts"] = Json::array();
      for (const auto& part : row.credentials.parts) one["parts"].push_back(part_json(part));
      one["allowed"] = Json::array();
      for (const auto& rule : row.credentials.permissions.rules)
        one["allowed"].push_back({{"publish", rule.publish}, {"topics", rule.topics}, {"partitions", rule.partitions}});
    }
    j["participants"].push_back(std::move(one));
  }
  j["warnings"] = report.warnings;
  return j.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace booth::daemon
