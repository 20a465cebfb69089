// From the kernel's folders to values; each device is looked at by itself, so that a broken one costs only itself.
#include "drivers/usb/sysfs_topology.hpp"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "drivers/usb/descriptors.hpp"

namespace booth::drivers::usb {
namespace {

using hal::UsbSpeed;
namespace fs = std::filesystem;

constexpr std::size_t kMostDescriptorBytes = 65'536;
constexpr int kXhciClass = 0x0C0330;

/// Makers of USB controllers by their PCI number (the public registry of the PCI-SIG).
std::string vendor_name(std::uint16_t vendor) {
  struct Maker {
    std::uint16_t number;
    const char* name;
  };
  static constexpr std::array<Maker, 16> kMakers{{{0x1002, "AMD"},
                                                  {0x1022, "AMD"},
                                                  {0x1033, "NEC"},
                                                  {0x104C, "Texas Instruments"},
                                                  {0x106B, "Apple"},
                                                  {0x1106, "VIA"},
                                                  {0x10DE, "NVIDIA"},
                                                  {0x15AD, "VMware"},
                                                  {0x177D, "Cavium"},
                                                  {0x1912, "Renesas"},
                                                  {0x1B21, "ASMedia"},
                                                  {0x1B36, "Red Hat (virtual)"},
                                                  {0x1B6F, "Etron"},
                                                  {0x1B73, "Fresco Logic"},
                                                  {0x1D17, "Zhaoxin"},
                                                  {0x8086, "Intel"}}};
  for (const Maker& m : kMakers)
    if (m.number == vendor) return m.name;
  return "unknown";
}

UsbSpeed speed_of(const std::string& text) {
  static const std::map<std::string, UsbSpeed> kSpeeds{{"1.5", UsbSpeed::low_1_5},     {"12", UsbSpeed::full_12},        {"480", UsbSpeed::high_480},
                                                       {"5000", UsbSpeed::super_5000}, {"10000", UsbSpeed::super_10000}, {"20000", UsbSpeed::super_20000}};
  const auto it = kSpeeds.find(text);
  return it == kSpeeds.end() ? UsbSpeed::unknown : it->second;
}

std::uint16_t word(std::optional<int> n) { return n && *n <= 0xFFFF ? static_cast<std::uint16_t>(*n) : std::uint16_t{0}; }

std::string group_name(gid_t gid) {
  std::array<char, 4096> buffer{};
  group entry{}, *found = nullptr;
  if (::getgrgid_r(gid, &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr) return found->gr_name;
  return std::to_string(gid);
}

/// Bus number of "usb7", else 0.
int root_number(const std::string& name) {
  const auto port = name.starts_with("usb") ? parse_port_name(name.substr(3) + "-1") : std::nullopt;
  return port && port->hub == name ? port->bus : 0;
}

class Reader {
 public:
  explicit Reader(const Sysfs& sysfs) : sysfs_(sysfs) {}

  hal::UsbTopology read() {
    out_.usbfs_memory_mb = sysfs_.number("sys/module/usbcore/parameters/usbfs_memory_mb");
    std::error_code error;
    out_.available = fs::is_directory(sysfs_.at("sys/bus/usb/devices"), error);
    const auto names = sysfs_.entries("sys/bus/usb/devices");
    for (const auto& name : names)
      if (root_number(name) != 0) device(name, root_number(name));
    for (const auto& name : names) {
      if (root_number(name) != 0 || name.find(':') != std::string::npos) continue;
      if (const auto port = parse_port_name(name)) {
        device(name, port->bus);
      } else {
        out_.remarks.push_back("sys/bus/usb/devices has an entry that is no port's name; it was left out");
      }
    }
    controllers_without_buses();
    add_reservations();
    std::sort(out_.controllers.begin(), out_.controllers.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
    std::sort(out_.devices.begin(), out_.devices.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
    return std::move(out_);
  }

 private:
  hal::UsbController controller_at(const fs::path& folder);
  void root_hub(const fs::path& folder, const hal::UsbDevice& hub);
  void device(const std::string& name, int bus);
  void interfaces(const fs::path& folder, hal::UsbDevice& device);
  void node(hal::UsbDevice& device);
  void controllers_without_buses();
  void add_reservations();

  const Sysfs& sysfs_;
  hal::UsbTopology out_;
};

hal::UsbController Reader::controller_at(const fs::path& folder) {
  hal::UsbController out;
  out.id = folder.filename().string();
  out.on_pci = is_pci_address(out.id);
  out.driver = sysfs_.link_name(folder / "driver");
  out.vendor_name = "unknown";
  if (!out.on_pci) return out;
  out.vendor = word(sysfs_.number(folder / "vendor", 16));
  out.device = word(sysfs_.number(folder / "device", 16));
  out.vendor_name = vendor_name(out.vendor);
  const auto driver = pci_driver_folder(out.driver);
  out.may_rebind = is_xhci_driver(out.driver) && sysfs_.writable(driver / "unbind") && sysfs_.writable(driver / "bind");
  const auto rate = [&](const fs::path& file) { return std::clamp(std::atof(sysfs_.text(file).value_or("0").c_str()), 0.0, 1000.0); };
  for (fs::path at = folder; is_pci_address(at.filename().string()); at = at.parent_path()) {
    hal::PcieLink link{.address = at.filename().string(),
                       .width = std::min(64, sysfs_.number(at / "current_link_width").value_or(0)),
                       .widest = std::min(64, sysfs_.number(at / "max_link_width").value_or(0)),
                       .gigatransfers = rate(at / "current_link_speed"),
                       .fastest = rate(at / "max_link_speed")};
    if (link.width > 0 && link.gigatransfers > 0) out.links.push_back(std::move(link));
  }
  return out;
}

void Reader::root_hub(const fs::path& folder, const hal::UsbDevice& hub) {
  const fs::path above = folder.parent_path();
  const std::string id = above.filename().string();
  auto it = std::find_if(out_.controllers.begin(), out_.controllers.end(), [&](const auto& c) { return c.id == id; });
  if (it == out_.controllers.end()) it = out_.controllers.insert(it, controller_at(above));
  it->buses.push_back({.number = hub.bus, .speed = hub.speed, .ports = std::min(255, sysfs_.number(folder / "maxchild").value_or(0))});
}

void Reader::device(const std::string& name, int bus) {
  const auto folder = sysfs_.resolve(fs::path("sys/bus/usb/devices") / name);
  if (!folder) {
    out_.remarks.push_back("sys/bus/usb/devices/" + name + " leads nowhere; it was left out");
    return;
  }
  hal::UsbDevice d{.path = name, .bus = bus};
  if (sysfs_.number(*folder / "busnum").value_or(bus) != bus) out_.remarks.push_back(name + " says that it is on another bus than its name");
  d.address = std::min(127, sysfs_.number(*folder / "devnum").value_or(0));
  d.vendor = word(sysfs_.number(*folder / "idVendor", 16));
  d.product = word(sysfs_.number(*folder / "idProduct", 16));
  d.device_class = static_cast<std::uint8_t>(sysfs_.number(*folder / "bDeviceClass", 16).value_or(0));
  d.product_name = sysfs_.text(*folder / "product").value_or("");
  d.serial = sysfs_.text(*folder / "serial").value_or("");
  d.speed = speed_of(sysfs_.text(*folder / "speed").value_or(""));
  if (d.speed == UsbSpeed::unknown) out_.remarks.push_back(name + " does not say its speed");
  d.configuration = sysfs_.number(*folder / "bConfigurationValue").value_or(0);
  d.stays_awake = sysfs_.text(*folder / "power/control").value_or("") == "on";
  d.runtime_status = sysfs_.text(*folder / "power/runtime_status").value_or("");
  interfaces(*folder, d);
  node(d);
  if (root_number(name) != 0) {
    root_hub(*folder, d);
  } else if (const auto attribute = port_switch(sysfs_, *parse_port_name(name))) {
    d.port_switch = true;
    d.may_switch_port = sysfs_.writable(*attribute);
  }
  if (const auto* controller = controller_of_bus(out_, bus)) d.controller = controller->id;
  out_.devices.push_back(std::move(d));
}

void Reader::interfaces(const fs::path& folder, hal::UsbDevice& d) {
  const auto settings = alternate_settings(sysfs_.bytes(folder / "descriptors", kMostDescriptorBytes), d.speed);
  const std::string prefix = (root_number(d.path) != 0 ? d.path.substr(3) + "-0" : d.path) + ":" + std::to_string(d.configuration) + ".";
  for (const auto& name : sysfs_.entries(folder)) {
    if (!name.starts_with(prefix)) continue;
    const auto number = sysfs_.number(folder / name / "bInterfaceNumber", 16);
    if (!number || *number > 255) continue;
    hal::UsbInterface i{.number = *number, .alternate = std::min(255, sysfs_.number(folder / name / "bAlternateSetting").value_or(0))};
    i.device_class = static_cast<std::uint8_t>(sysfs_.number(folder / name / "bInterfaceClass", 16).value_or(0));
    i.driver = sysfs_.link_name(folder / name / "driver");
    for (const auto& s : settings)
      if (s.configuration == d.configuration && s.interface == i.number && s.alternate == i.alternate) i.reserved = s.reserved;
    d.interfaces.push_back(std::move(i));
  }
}

void Reader::node(hal::UsbDevice& d) {
  std::array<char, 40> name{};
  std::snprintf(name.data(), name.size(), "/dev/bus/usb/%03d/%03d", d.bus, d.address);
  d.node = name.data();
  const auto file = sysfs_.root() / d.node.substr(1);
  struct stat s {};
  d.node_exists = ::stat(file.c_str(), &s) == 0;
  if (!d.node_exists) return;
  d.node_mode = s.st_mode & 07777;
  d.node_group = group_name(s.st_gid);
  d.may_open = ::access(file.c_str(), R_OK | W_OK) == 0;
}

void Reader::controllers_without_buses() {
  for (const auto& address : sysfs_.entries("sys/bus/pci/devices")) {
    if (!is_pci_address(address) || find_controller(out_, address) != nullptr) continue;
    const auto folder = sysfs_.resolve(fs::path("sys/bus/pci/devices") / address);
    if (!folder || sysfs_.number(*folder / "class", 16).value_or(0) != kXhciClass) continue;
    out_.controllers.push_back(controller_at(*folder));
    out_.controllers.back().id = address;
  }
}

void Reader::add_reservations() {
  for (auto& controller : out_.controllers)
    for (auto& bus : controller.buses)
      for (const auto& d : out_.devices)
        if (d.bus == bus.number)
          for (const auto& i : d.interfaces) bus.reserved += i.reserved;
}

class SysfsTopology final : public hal::UsbTopologySource {
 public:
  explicit SysfsTopology(fs::path root) : sysfs_(std::move(root)) {}
  hal::UsbTopology read() const override { return Reader(sysfs_).read(); }

 private:
  const Sysfs sysfs_;
};

}  // namespace

std::optional<fs::path> port_switch(const Sysfs& sysfs, const PortName& port) {
  const auto hub = sysfs.resolve(fs::path("sys/bus/usb/devices") / port.hub);
  if (!hub) return std::nullopt;
  // A hub has one configuration and one interface; a root calls its own "2-0:1.0".
  const std::string interface = (root_number(port.hub) != 0 ? std::to_string(port.bus) + "-0" : port.hub) + ":1.0";
  const fs::path attribute = *hub / interface / (port.hub + "-port" + std::to_string(port.port)) / "disable";
  return sysfs.is_attribute(attribute) ? std::optional(attribute) : std::nullopt;
}

fs::path pci_driver_folder(const std::string& driver) { return fs::path("sys/bus/pci/drivers") / (is_xhci_driver(driver) ? driver : "none"); }

std::unique_ptr<hal::UsbTopologySource> make_sysfs_topology(fs::path root) { return std::make_unique<SysfsTopology>(std::move(root)); }

}  // namespace booth::drivers::usb
