// Folders that are whole or not there.
#include "daemon/security/fleet_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/security/certificates.hpp"
#include "daemon/security/credentials.hpp"
#include "daemon/security/signed_document.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostBytes = 1 << 20;
constexpr std::int64_t kBackdated = 3600;  ///< so that a booth whose clock is a little slow accepts what was issued just now

[[noreturn]] void fail(const char* doing, const fs::path& path) {
  throw std::runtime_error(fmt::format("cannot {} {}: {}", doing, path.string(), std::strerror(errno)));
}

void sync_folder(const fs::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) fail("flush", folder);
  (void)::fsync(fd);
  ::close(fd);
}

/// A folder under a temporary name, removed with everything in it unless it was put in its place.
class NewFolder {
 public:
  explicit NewFolder(fs::path place) : place_(std::move(place)) {
    const fs::path parent = place_.has_parent_path() ? place_.parent_path() : fs::path(".");
    std::string name = (parent / ("." + place_.filename().string() + ".XXXXXX")).string();
    if (::mkdtemp(name.data()) == nullptr) fail("create a folder beside", place_);
    temporary_ = name;
  }
  ~NewFolder() {
    std::error_code ignored;
    if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
  }
  NewFolder(const NewFolder&) = delete;

  void write(const char* name, const std::string& contents, mode_t mode = 0644) const { write_file_atomically(temporary_ / name, contents, mode); }
  void make_folder(const char* name) const {
    if (::mkdir((temporary_ / name).c_str(), 0700) != 0) fail("create", temporary_ / name);
  }
  /// Fails where something has come to be there meanwhile.
  void put_in_place() {
    sync_folder(temporary_);
    if (::renameat2(AT_FDCWD, temporary_.c_str(), AT_FDCWD, place_.c_str(), RENAME_NOREPLACE) != 0) fail("put in place", place_);
    temporary_.clear();
    sync_folder(place_.has_parent_path() ? place_.parent_path() : fs::path("."));
  }
  /// At no instant is there neither the old folder nor the new one; the old one is gone afterwards.
  void replace() {
    sync_folder(temporary_);
    if (::renameat2(AT_FDCWD, temporary_.c_str(), AT_FDCWD, place_.c_str(), RENAME_EXCHANGE) != 0) fail("replace", place_);
    sync_folder(place_.parent_path());
  }

 private:
  fs::path place_, temporary_;
};

PemPair read_authority(const fs::path& folder, const char* certificate, const char* key) {
  try {
    return {read_file_bytes(folder / certificate, kMostBytes), read_file_bytes(folder / key, kMostBytes)};
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{} is not the folder of a fleet that may issue: {}; `boothctl security init` makes one", folder.string(), e.what()));
  }
}

void check_days(std::int64_t days) {
  if (days < 1 || days > 36'500) throw std::runtime_error(fmt::format("{} days of validity: choose from 1 to 36500", days));
}

void check_order(const IssueOrder& order) {
  if (const std::string wrong = name_objection(order.name); !wrong.empty()) throw std::runtime_error(fmt::format("\"{}\" {}", order.name, wrong));
  check_days(order.days);
  if (order.role == Role::booth) return;
  if (order.booths.empty())
    throw std::runtime_error(fmt::format("a {} needs the booths that it may {}: their names, or '*' for all", role_name(order.role),
                                         order.role == Role::viewer ? "hear" : "hear and command"));
  for (const auto& booth : order.booths)
    if (booth != "*" && !name_objection(booth).empty()) throw std::runtime_error(fmt::format("\"{}\" {}", booth, name_objection(booth)));
}

}  // namespace

std::string name_objection(const std::string& name) {
  const auto good = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_'; };
  return !name.empty() && name.size() <= 32 && std::all_of(name.begin(), name.end(), good) ? "" : "is no name: 1 to 32 letters, digits, '-' or '_'";
}

void make_fleet(const fs::path& given, const std::string& name, std::int64_t days, std::int64_t now) {
  const fs::path folder = given.has_filename() ? given : given.parent_path();
  if (const std::string wrong = name_objection(name); !wrong.empty()) throw std::runtime_error(fmt::format("\"{}\" {}", name, wrong));
  check_days(days);
  std::error_code error;
  if (fs::exists(folder, error)) {
    if (!fs::is_directory(folder, error) || !fs::is_empty(folder, error) || error)
      throw std::runtime_error(fmt::format("{} exists and is not empty: a fleet is never overwritten; choose another folder", folder.string()));
    if (::rmdir(folder.c_str()) != 0) fail("use the empty folder", folder);
  }
  const Validity valid{now - kBackdated, now + days * kSecondsOfDay};
  const PemPair identities = make_authority(name + " identities", valid), permissions = make_authority(name + " permissions", valid);
  NewFolder fresh(folder);
  fresh.write(kIdentityAuthorityFile, identities.certificate);
  fresh.write(kIdentityAuthorityKeyFile, identities.key, 0600);
  fresh.write(kPermissionsAuthorityFile, permissions.certificate);
  fresh.write(kPermissionsAuthorityKeyFile, permissions.key, 0600);
  fresh.write("governance.xml", governance_xml());
  fresh.write(kGovernanceFile, sign_document(governance_xml(), permissions));
  fresh.make_folder(kIssuedFolder);
  fresh.put_in_place();
}

fs::path issue(const fs::path& folder, const IssueOrder& order, std::int64_t now) {
  check_order(order);
  const PemPair identities = read_authority(folder, kIdentityAuthorityFile, kIdentityAuthorityKeyFile);
  const PemPair permissions = read_authority(folder, kPermissionsAuthorityFile, kPermissionsAuthorityKeyFile);
  const std::string who = identity_name(order.role, order.name);
  fs::path place = folder / kIssuedFolder / who;
  std::error_code error;
  const bool there = fs::exists(place, error);
  if (there && !order.renew)
    throw std::runtime_error(
        fmt::format("{} was issued before and is not overwritten; --renew replaces it, `boothctl security show` says until when it serves", place.string()));
  const std::int64_t authority_until = std::min(read_certificate(identities.certificate).valid.until, read_certificate(permissions.certificate).valid.until);
  if (authority_until <= now)
    throw std::runtime_error(
        fmt::format("the authorities in {} expired on {}: make a new fleet with `boothctl security init`", folder.string(), utc_day(authority_until)));
  const Validity valid{now - kBackdated, std::min(now + order.days * kSecondsOfDay, authority_until)};
  const PemPair pair = issue_certificate(identities, who, valid);
  const auto rules = rules_for(order.role, order.role == Role::booth ? std::vector<std::string>{order.name} : order.booths);
  NewFolder fresh(place);
  fresh.write(kCertificateFile, pair.certificate);
  fresh.write(kKeyFile, pair.key, 0600);
  fresh.write(kIdentityAuthorityFile, identities.certificate);
  fresh.write(kPermissionsAuthorityFile, permissions.certificate);
  fresh.write(kGovernanceFile, read_file_bytes(folder / kGovernanceFile, kMostBytes));
  fresh.write(kPermissionsFile, sign_document(permissions_xml(who, rules, valid), permissions));
  if (fs::exists(folder / kRevocationsFile, error)) fresh.write(kRevocationsFile, read_file_bytes(folder / kRevocationsFile, kMostBytes));
  if (there)
    fresh.replace();
  else
    fresh.put_in_place();
  return place;
}

void revoke(const fs::path& folder, const std::vector<std::string>& serials, std::int64_t now) {
  const PemPair identities = read_authority(folder, kIdentityAuthorityFile, kIdentityAuthorityKeyFile);
  std::vector<std::string> all = serials;
  std::error_code error;
  if (fs::exists(folder / kRevocationsFile, error))
    for (const auto& old : read_revocations(read_file_bytes(folder / kRevocationsFile, kMostBytes), identities.certificate)) all.push_back(old);
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  // A list that is overdue is refused by the library, and with it everybody: it serves as long as its authority.
  const Validity valid{now - kBackdated, read_certificate(identities.certificate).valid.until};
  write_file_atomically(folder / kRevocationsFile, make_revocations(identities, all, valid));
}

}  // namespace booth::daemon
