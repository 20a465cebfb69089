// What `boothctl doctor` looks at: small checks in groups, each with what was seen and what to do about it.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "hal/gpio_chips.hpp"
#include "hal/usb_topology.hpp"

struct stat;
struct statvfs;

namespace booth::daemon {

enum class CheckResult : std::uint8_t { ok, warning, error, skipped };
const char* to_string(CheckResult result);

struct Check {
  std::string group, name;
  CheckResult result = CheckResult::ok;
  std::string seen;
  std::string advice{};  ///< what to do; empty where nothing needs doing
};
using Checks = std::vector<Check>;

/// Everything that checks may look at. `root` stands for "/", so that a planted tree can be examined.
struct DoctorInputs {
  Config config;
  std::string config_problem;  ///< why the configuration could not be loaded; defaults are examined then
  std::filesystem::path root = "/";
  hal::UsbTopology usb;
  std::vector<std::string> serials;    ///< of the sensors that the configuration names, in the order of their positions
  std::optional<hal::GpioChips> gpio;  ///< nothing where another root than "/" is examined: lines are asked for through /dev
  double usbfs_bytes_per_sensor = 0;
  bool (*is_sensor)(const hal::UsbDevice&) = nullptr;
};

// One group each, in a file of its own. A new group is one function and one line in run_checks().
Checks check_usb(const DoctorInputs& in);
Checks check_cameras(const DoctorInputs& in);
Checks check_clock(const DoctorInputs& in);
Checks check_files(const DoctorInputs& in);
Checks check_disk(const DoctorInputs& in);
Checks check_dds(const DoctorInputs& in);
Checks check_security(const DoctorInputs& in);
Checks check_ros2(const DoctorInputs& in);
Checks check_gpio(const DoctorInputs& in);

// What check_disk() and check_dds() think of what the kernel said.
Check judge_disk(const Config& config, const struct statvfs& disk);
struct Account {
  std::string name;
  uid_t user = 0;
  std::vector<gid_t> groups;  ///< its own one among them
};
/// Whether boothd may write into the folder, by owner and mode.
Check judge_folder(const std::string& folder, const struct stat& there, const Account& boothd);
struct NetworkAddress {
  std::string interface, address;  ///< without an IPv4 address: empty
  bool up = false, loopback = false;
};
Check judge_network(const std::string& wanted, const std::vector<NetworkAddress>& there);

/// All groups in the order in which they are printed. Never throws for what it finds on the machine.
Checks run_checks(const DoctorInputs& in);

}  // namespace booth::daemon
