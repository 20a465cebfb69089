// The order of the groups, and the groups that are a few lines each: clock, disk, DDS.
#include "daemon/health/checks.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/timex.h>

#include <algorithm>
#include <cerrno>
#include <set>

namespace booth::daemon {

const char* to_string(CheckResult result) {
  switch (result) {
    case CheckResult::ok:
      return "ok";
    case CheckResult::warning:
      return "warning";
    case CheckResult::error:
      return "error";
    case CheckResult::skipped:
      return "skipped";
  }
  return "?";
}

Checks check_clock(const DoctorInputs&) {
  timex state{};
  const int answer = ::adjtimex(&state);
  if (answer < 0) return {{"clock", "synchronised", CheckResult::skipped, "the kernel does not say (adjtimex is refused)"}};
  if (answer == TIME_ERROR || (state.status & STA_UNSYNC) != 0)
    return {{"clock", "synchronised", CheckResult::warning, "the clock is not synchronised: time stamps on the wire are marked so",
             "run systemd-timesyncd or chrony"}};
  return {{"clock", "synchronised", CheckResult::ok, fmt::format("synchronised, at most {:.1f} ms off", static_cast<double>(state.maxerror) / 1000)}};
}

Check judge_disk(const Config& config, const struct statvfs& s) {
  const double free = static_cast<double>(s.f_bavail) * static_cast<double>(s.f_frsize), quota = static_cast<double>(config.session.quota_bytes);
  const std::string seen = fmt::format("{} has {:.1f} GB free, session.quota_bytes allows {}", config.session.directory, free / 1e9,
                                       quota > 0 ? fmt::format("{:.1f} GB", quota / 1e9) : "any amount");
  const auto result = [](CheckResult how, std::string what, std::string advice) { return Check{"disk", "sessions", how, std::move(what), std::move(advice)}; };
  if ((s.f_flag & ST_RDONLY) != 0)
    return result(CheckResult::error, config.session.directory + " is on a disk that can only be read",
                  "see the kernel's log: a disk with errors is often made read-only; sessions that cannot be written are lost");
  if (s.f_files > 0 && s.f_favail == 0)
    return result(CheckResult::error, config.session.directory + " is on a disk that takes no more files, whatever room it has (df -i)",
                  "delete files: sessions that cannot be written are lost");
  if (free < 1e9) return result(CheckResult::error, seen, "make room: sessions that cannot be written are lost");
  if (quota > free) return result(CheckResult::warning, seen, "the disk may be full before the quota is used: lower session.quota_bytes, or make room");
  return result(CheckResult::ok, seen, "");
}

Check judge_folder(const std::string& folder, const struct stat& there, const Account& boothd) {
  const bool own = there.st_uid == boothd.user, member = std::count(boothd.groups.begin(), boothd.groups.end(), there.st_gid) > 0;
  const mode_t asked = (own ? S_IWUSR | S_IXUSR : member ? S_IWGRP | S_IXGRP : S_IWOTH | S_IXOTH);
  if (!S_ISDIR(there.st_mode))
    return {"disk", "session folder", CheckResult::error, folder + " is no folder",
            "move it away, or see session.directory: sessions that cannot be written are lost"};
  if (boothd.user != 0 && (there.st_mode & asked) != asked)
    return {"disk", "session folder", CheckResult::error, fmt::format("user {} may not write into {}", boothd.name, folder),
            fmt::format("chown {} {}: sessions that cannot be written are lost", boothd.name, folder)};
  return {"disk", "session folder", CheckResult::ok, fmt::format("{} belongs to who writes there", folder)};
}

/// Whoever runs boothd from the package; on a machine without that user nothing is said of it.
std::optional<Account> boothd_account() {
  const passwd* user = ::getpwnam("boothd");
  if (user == nullptr) return std::nullopt;
  Account out{"boothd", user->pw_uid, std::vector<gid_t>(64)};
  int count = static_cast<int>(out.groups.size());
  if (::getgrouplist("boothd", user->pw_gid, out.groups.data(), &count) < 0) count = static_cast<int>(out.groups.size());
  out.groups.resize(static_cast<std::size_t>(count));
  return out;
}

Check check_session_folder(const Config& config) {
  const std::string& folder = config.session.directory;
  const auto account = boothd_account();
  struct stat there {};
  if (!account) return {"disk", "session folder", CheckResult::skipped, "there is no user boothd: the package is not installed here"};
  if (::stat(folder.c_str(), &there) == 0) return judge_folder(folder, there, *account);
  if (errno == ENOENT) return {"disk", "session folder", CheckResult::ok, folder + " is not there yet: boothd makes it"};
  return {"disk", "session folder", CheckResult::skipped, folder + " cannot be seen by this user; run doctor as root"};
}

Checks check_disk(const DoctorInputs& in) {
  std::filesystem::path folder = in.config.session.directory;
  std::error_code error;
  while (!std::filesystem::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
  struct statvfs s {};
  if (::statvfs(folder.empty() ? "." : folder.c_str(), &s) != 0)
    return {{"disk", "sessions", CheckResult::warning, fmt::format("{} cannot be examined", in.config.session.directory),
             "does session.directory exist, may this user see it?"}};
  return {judge_disk(in.config, s), check_session_folder(in.config)};
}

Check judge_network(const std::string& wanted, const std::vector<NetworkAddress>& there) {
  const auto result = [](CheckResult how, std::string what, std::string advice) { return Check{"dds", "interface", how, std::move(what), std::move(advice)}; };
  std::set<std::string> up;
  bool found = false, found_up = false, usable = false, beyond = false;
  for (const NetworkAddress& a : there) {
    const bool same = wanted == a.interface || wanted == a.address, serves = !a.address.empty();
    if (a.up) up.insert(a.interface);
    found = found || same;
    found_up = found_up || (same && a.up);
    usable = usable || (same && a.up && serves);
    beyond = beyond || (a.up && serves && !a.loopback);
  }
  std::string names;
  for (const auto& name : up) names += (names.empty() ? "" : ", ") + name;
  if (wanted.empty() && !beyond)
    return result(CheckResult::warning, "no interface but loopback is up and has an IPv4 address: nobody on another machine hears this booth",
                  "look at cable, switch and DHCP (ip address); boothd takes the network when it comes");
  if (wanted.empty()) return result(CheckResult::ok, "the library chooses among " + names, "");
  if (!found) return result(CheckResult::error, fmt::format("dds.interface \"{}\" does not exist; up are {}", wanted, names), "name one of them, or none");
  if (!found_up) return result(CheckResult::error, fmt::format("dds.interface \"{}\" is down", wanted), "bring it up, or name another");
  // boothd looks no closer where an IPv6 address is asked for.
  if (!usable && wanted.find(':') == std::string::npos)
    return result(CheckResult::error, fmt::format("dds.interface \"{}\" is up and has no IPv4 address: nobody hears this booth", wanted),
                  "look at cable, switch and DHCP (ip address); boothd takes the network when it comes");
  return result(CheckResult::ok, wanted + " is up", "");
}

Checks check_dds(const DoctorInputs& in) {
  if (!in.config.dds.enabled) return {{"dds", "interface", CheckResult::skipped, "dds.enabled is false"}};
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) return {{"dds", "interface", CheckResult::skipped, "the network interfaces cannot be listed"}};
  std::vector<NetworkAddress> there;
  for (const ifaddrs* a = list; a != nullptr; a = a->ifa_next) {
    char address[NI_MAXHOST] = "";
    const int family = a->ifa_addr == nullptr ? AF_UNSPEC : a->ifa_addr->sa_family;
    const bool asked_for = family == AF_INET || (family == AF_INET6 && in.config.dds.interface.find(':') != std::string::npos);
    if (asked_for)
      (void)::getnameinfo(a->ifa_addr, family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6), address, sizeof address, nullptr, 0, NI_NUMERICHOST);
    there.push_back({a->ifa_name, address, (a->ifa_flags & IFF_UP) != 0, (a->ifa_flags & IFF_LOOPBACK) != 0});
  }
  ::freeifaddrs(list);
  return {judge_network(in.config.dds.interface, there)};
}

Checks run_checks(const DoctorInputs& in) {
  Checks out;
  if (in.config_problem.empty())
    out.push_back({"configuration", "loads", CheckResult::ok, "no mistakes"});
  else
    out.push_back({"configuration", "loads", CheckResult::error, in.config_problem, "boothd will not start like this; the checks below look at the defaults"});
  for (const auto group : {check_usb, check_cameras, check_files, check_clock, check_disk, check_dds, check_security, check_ros2, check_gpio})
    for (auto& check : group(in)) out.push_back(std::move(check));
  return out;
}

}  // namespace booth::daemon
