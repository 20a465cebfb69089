// Controllers, links, memory and permissions: what decides whether four sensors can stream at all.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "daemon/health/checks.hpp"

namespace booth::daemon {
namespace {

using hal::UsbController;
using hal::UsbDevice;

/// What one sensor reserves on its bus: 33,792 bytes in each 125 us (docs/reference/kinect2.md).
constexpr double kReserved = 33'792 / 125e-6;
constexpr double kMiB = 1024.0 * 1024.0;

struct Usb {
  const DoctorInputs& in;
  bool wanted = false;  ///< the configuration works with sensors
  std::vector<const UsbDevice*> sensors;
  Checks out;

  void add(CheckResult result, std::string name, std::string seen, std::string advice = "") {
    out.push_back({"usb", std::move(name), result, std::move(seen), std::move(advice)});
  }
  std::string place(const UsbDevice& d) const { return fmt::format("{} at port {}", d.serial.empty() ? "sensor without a serial" : d.serial, d.path); }

  void controllers();
  void shared();
  void speed();
  void links();
  void memory();
  void permissions();
  void manners();
  void rescue();
};

struct Repute {
  CheckResult result;
  const char* text;
};

/// Experience of the field with each maker's controllers; without a sensor on it even a bad one harms nobody.
Repute repute(const UsbController& c) {
  if (!c.on_pci) return {CheckResult::ok, ""};
  switch (c.vendor) {
    case 0x8086:
    case 0x1033:
    case 0x1912:
      return {CheckResult::ok, ""};
    case 0x1B21:
      return {CheckResult::error, "ASMedia controllers deliver no depth or half of the frames, or die"};
    case 0x1B6F:
      return {CheckResult::error, "Etron controllers stay dead until a reboot once they have failed"};
    case 0x1106:
      return {CheckResult::error, "VIA controllers deliver no depth or poor depth"};
    case 0x1022:
    case 0x1002:
      return {CheckResult::warning, "AMD controllers have been reported with command time-outs and broken depth"};
    case 0x104C:
      return {CheckResult::warning, "Texas Instruments controllers have been reported with poor depth"};
    default:
      return {CheckResult::warning, "nothing is known of this maker's controllers with a Kinect v2"};
  }
}

void Usb::controllers() {
  if (in.usb.controllers.empty())
    return add(wanted ? CheckResult::error : CheckResult::skipped, "controllers", "no USB controller was found", wanted ? "put in a USB 3 card" : "");
  std::string all;
  for (const auto& c : in.usb.controllers) {
    all += fmt::format("{}{} {} ({})", all.empty() ? "" : ", ", c.id, c.vendor_name, c.driver.empty() ? "no driver" : c.driver);
    for (const auto& b : c.buses)
      if (is_super(b.speed)) all += fmt::format(" bus {} {:.0f} Gbit/s, {:.2f} Gbit/s reserved", b.number, megabits(b.speed) / 1000, b.reserved * 8e-9);
  }
  add(CheckResult::ok, "controllers", all);
  for (const auto& c : in.usb.controllers) {
    if (c.on_pci && c.driver.empty())
      add(wanted ? CheckResult::error : CheckResult::warning, "controller " + c.id, "is bound to no driver",
          fmt::format("as root: echo {} > /sys/bus/pci/drivers/xhci_hcd/bind", c.id));
    else if (c.on_pci && c.buses.empty())
      add(CheckResult::error, "controller " + c.id, "has died: it has a driver but no bus",
          fmt::format("as root: echo {0} > /sys/bus/pci/drivers/{1}/unbind; echo {0} > /sys/bus/pci/drivers/{1}/bind; or restart the machine", c.id, c.driver));
    const bool used = std::any_of(sensors.begin(), sensors.end(), [&](const auto* d) { return d->controller == c.id; });
    const Repute known = repute(c);
    if (used && known.result != CheckResult::ok)
      add(known.result, "controller " + c.id, fmt::format("{} carries a sensor: {}", c.vendor_name, known.text),
          "use a card with Intel, Renesas or NEC controllers (docs/guide/hardware.md)");
  }
}

void Usb::shared() {
  if (sensors.empty()) return;
  const auto groups = sharing_a_bus(sensors);
  if (groups.empty()) return add(CheckResult::ok, "one sensor per controller", "no two sensors share a SuperSpeed bus");
  for (const auto& group : groups) {
    std::string names;
    for (const auto* d : group) names += (names.empty() ? "" : ", ") + place(*d);
    add(CheckResult::error, "one sensor per controller",
        fmt::format("{} share controller {}, whose bus {} has room for one", names, group.front()->controller, group.front()->bus),
        "give each sensor a controller of its own: another card, or a card with four controllers");
  }
}

void Usb::speed() {
  bool good = true;
  for (const auto* d : sensors)
    if (!is_super(d->speed)) {
      good = false;
      add(CheckResult::error, "USB 3 speed", fmt::format("{} is connected at USB 2 speed", place(*d)),
          "use a blue USB 3 port and the original cable, without a hub or an extension");
    }
  if (good && !sensors.empty()) add(CheckResult::ok, "USB 3 speed", "all sensors are connected at SuperSpeed");
  for (const auto* d : sensors)
    if (is_super(d->speed) && d->configuration == 0)
      add(CheckResult::error, "configured", fmt::format("the kernel did not configure {}", place(*d)),
          "usually its controller has no bandwidth left: move it to another controller");
}

void Usb::links() {
  // A link is used by every sensor below it, be it the controller's own or the slot of a card with several.
  std::map<std::string, std::pair<hal::PcieLink, int>> used;
  for (const auto* d : sensors)
    if (const auto* c = find_controller(in.usb, d->controller))
      for (const auto& link : c->links) {
        auto& entry = used[link.address];
        entry.first = link;
        ++entry.second;
      }
  bool good = true;
  for (const auto& [address, entry] : used) {
    const auto& [link, count] = entry;
    const std::string what = fmt::format("{} runs x{} at {} GT/s ({:.0f} MB/s) below {} sensor{} that reserve {:.0f} MB/s", address, link.width,
                                         link.gigatransfers, link.capacity() / 1e6, count, count == 1 ? "" : "s", count * kReserved / 1e6);
    if (link.capacity() < count * kReserved) {
      good = false;
      add(CheckResult::error, "PCIe link", what, "put the card into a slot of x4 or wider, PCIe 2.0 or later");
    } else if (link.width < link.widest || link.gigatransfers < link.fastest) {
      good = false;
      add(CheckResult::warning, "PCIe link", fmt::format("{}; it could do x{} at {} GT/s", what, link.widest, link.fastest),
          "try another slot, and the firmware's settings of this one");
    }
  }
  if (good && !used.empty()) add(CheckResult::ok, "PCIe link", "wide and fast enough for the sensors below");
}

void Usb::memory() {
  const auto count = static_cast<double>(std::max(sensors.size(), wanted ? in.serials.size() : std::size_t{0}));
  if (!in.usb.usbfs_memory_mb)
    return add(count > 0 ? CheckResult::warning : CheckResult::skipped, "usbfs memory",
               fmt::format("{} cannot be read", (in.root / "sys/module/usbcore/parameters/usbfs_memory_mb").string()));
  const int limit = *in.usb.usbfs_memory_mb;
  const double needed = count * in.usbfs_bytes_per_sensor;
  const std::string seen = limit == 0 ? "no limit" : fmt::format("{} MiB for {} sensors that need {:.1f} MiB", limit, count, needed / kMiB);
  const std::string advice =
      "add usbcore.usbfs_memory_mb=256 to the kernel's command line; until the next start, as root: echo 256 > /sys/module/usbcore/parameters/usbfs_memory_mb";
  if (limit != 0 && limit * kMiB < needed) return add(CheckResult::error, "usbfs memory", seen, advice);
  if (limit != 0 && limit < 128 && count > 0) return add(CheckResult::warning, "usbfs memory", seen + ", with little to spare", advice);
  add(CheckResult::ok, "usbfs memory", seen);
}

void Usb::permissions() {
  bool rule = false;
  for (const char* folder : {"etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d"}) {
    std::error_code error;
    rule = rule || std::filesystem::exists(in.root / folder / "90-boothd-kinect2.rules", error);
  }
  if (wanted || !sensors.empty())
    add(rule ? CheckResult::ok : CheckResult::warning, "udev rule", rule ? "90-boothd-kinect2.rules is installed" : "90-boothd-kinect2.rules is not installed",
        rule ? "" : "copy systemd/90-boothd-kinect2.rules to /etc/udev/rules.d, run udevadm control --reload and plug the sensors in again");
  for (const auto* d : sensors) {
    const bool for_boothd = d->node_group == "boothd" && (d->node_mode & 0060) == 0060;
    if (!d->node_exists)
      add(CheckResult::error, "permissions", fmt::format("{} has no device node {}", place(*d), d->node), "is /dev/bus/usb there, and does udev run?");
    else if (!d->may_open && !for_boothd)
      add(CheckResult::error, "permissions", fmt::format("{} ({}, group {}, mode {:o}) may not be opened", place(*d), d->node, d->node_group, d->node_mode),
          "install the udev rule and plug the sensor in again");
    else
      add(CheckResult::ok, "permissions", fmt::format("{} may be opened ({}, group {}, mode {:o})", place(*d), d->node, d->node_group, d->node_mode));
  }
}

void Usb::manners() {
  for (const auto* d : sensors) {
    for (const auto& i : d->interfaces)
      if (i.driver == "snd-usb-audio") {
        add(CheckResult::warning, "audio", fmt::format("snd-usb-audio has taken the microphones of {} and may reserve bandwidth", place(*d)),
            "install the udev rule, which unbinds them, and plug the sensor in again");
        break;
      }
    if (!d->stays_awake)
      add(CheckResult::warning, "autosuspend", fmt::format("the kernel may suspend {}", place(*d)),
          "install the udev rule, or as root: echo on > /sys/bus/usb/devices/" + d->path + "/power/control");
  }
}

void Usb::rescue() {
  int ports = 0, controllers = 0;
  for (const auto* d : sensors) {
    ports += d->may_switch_port;
    const auto* c = find_controller(in.usb, d->controller);
    controllers += c != nullptr && c->may_rebind;
  }
  if (!sensors.empty())
    add(ports + controllers > 0 ? CheckResult::ok : CheckResult::skipped, "recovery",
        fmt::format("this user may switch off the ports of {} and bind the controllers of {} of {} sensors; boothd's own user may be permitted less", ports,
                    controllers, sensors.size()));
}

}  // namespace

Checks check_usb(const DoctorInputs& in) {
  Usb usb{.in = in, .wanted = in.config.cameras.driver == "kinect2", .sensors = {}, .out = {}};
  if (!in.usb.available) {
    usb.add(usb.wanted ? CheckResult::error : CheckResult::skipped, "kernel",
            fmt::format("this machine has no USB (no {})", (in.root / "sys/bus/usb").string()),
            usb.wanted ? "use a machine with USB 3, or another cameras.driver" : "");
    return usb.out;
  }
  for (const auto& d : in.usb.devices)
    if (in.is_sensor(d)) usb.sensors.push_back(&d);
  usb.controllers();
  usb.shared();
  usb.speed();
  usb.links();
  usb.memory();
  usb.permissions();
  usb.manners();
  usb.rescue();
  for (const auto& remark : in.usb.remarks) usb.add(CheckResult::warning, "reading /sys", remark);
  return usb.out;
}

Checks check_cameras(const DoctorInputs& in) {
  Checks out;
  const auto add = [&](CheckResult result, std::string name, std::string seen, std::string advice = "") {
    out.push_back({"cameras", std::move(name), result, std::move(seen), std::move(advice)});
  };
  std::map<std::string, std::vector<const UsbDevice*>> present;
  for (const auto& d : in.usb.devices)
    if (in.is_sensor(d)) present[d.serial].push_back(&d);
  for (const auto& [serial, devices] : present)
    if (devices.size() > 1 && !serial.empty())
      add(CheckResult::error, "serials", fmt::format("{} is plugged in {} times", serial, devices.size()),
          "two sensors with one serial cannot be told apart: replace one");
  if (in.config.cameras.driver != "kinect2") {
    add(CheckResult::skipped, "sensors", fmt::format("cameras.driver is \"{}\"; {} sensors are plugged in", in.config.cameras.driver, present.size()));
    return out;
  }
  if (in.serials.empty())
    add(CheckResult::error, "sensors", "the configuration names no sensor", "set cameras.kinect2.serials, or cameras.kinect2.calibration with serials");
  for (const auto& serial : in.serials) {
    const auto it = present.find(serial);
    if (it == present.end())
      add(CheckResult::error, "sensors", serial + " is configured but not plugged in", "check its cable and its mains adaptor");
    else
      add(CheckResult::ok, "sensors", fmt::format("{} is at port {}, controller {}", serial, it->second.front()->path, it->second.front()->controller));
  }
  for (const auto& [serial, devices] : present)
    if (std::find(in.serials.begin(), in.serials.end(), serial) == in.serials.end())
      add(CheckResult::warning, "sensors",
          fmt::format("{} at port {} is plugged in but not configured", serial.empty() ? "a sensor without a serial" : serial, devices.front()->path),
          "add it to cameras.kinect2.serials, or unplug it");
  return out;
}

}  // namespace booth::daemon
