// What the kernel's folders may say about USB: raw descriptors, names of ports, and a tree whose attributes hold anything.
#include <array>
#include <cmath>
#include <fstream>
#include <string>

#include "drivers/usb/descriptors.hpp"
#include "drivers/usb/sysfs_topology.hpp"
#include "drivers/usb/usb_names.hpp"
#include "tests/drivers/usb/planted_sysfs.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth;
using fuzz::Input;
using fuzz::require;

std::string text(std::span<const std::byte> bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

void read_descriptors(Input& input) {
  const auto speed = static_cast<hal::UsbSpeed>(input.u8() % 7);
  for (const auto& setting : drivers::usb::alternate_settings(input.bytes(512), speed))
    require(std::isfinite(setting.reserved) && setting.reserved >= 0, "a reservation is a number of bytes per second");
}

void read_names(Input& input) {
  const std::string name = text(input.bytes(512));
  if (const auto port = drivers::usb::parse_port_name(name)) {
    require(port->bus >= 0 && port->bus <= 255 && port->port >= 0 && port->port <= 255, "numbers of ports are small");
    require(name.find('/') == std::string::npos && name.find("..") == std::string::npos, "the name of a port is no path");
  }
  if (drivers::usb::is_pci_address(name)) require(name.find('/') == std::string::npos && name.size() <= 16, "the address of a PCI function is no path");
}

/// A machine with two controllers and two sensors.
const tests::PlantedSysfs& machine() {
  static const tests::PlantedSysfs& planted = []() -> tests::PlantedSysfs& {
    static tests::PlantedSysfs tree;
    tree.controller({.link_width = "1", .link_speed = "5.0 GT/s PCIe", .switches = {"0000:00:1c.0"}});
    tree.controller({.address = "0000:03:00.0", .vendor = "0x1b21", .first_bus = 3});
    tree.sensor("2-1", {.streaming = true, .audio = true});
    tree.sensor("4-1", {.serial = "000000000002"});
    return tree;
  }();
  return planted;
}

/// Attributes become what the input says, and afterwards what they were.
void read_tree(Input& input) {
  static constexpr std::array<const char*, 12> kOfDevice{"busnum",      "devnum",  "idVendor", "idProduct",           "bDeviceClass",
                                                         "product",     "serial",  "speed",    "bConfigurationValue", "power/control",
                                                         "descriptors", "maxchild"};
  const auto& tree = machine();
  static const auto source = drivers::usb::make_sysfs_topology(tree.root());
  std::vector<std::pair<std::string, std::string>> before;
  for (int changes = 0; changes < 6 && !input.empty(); ++changes) {
    const unsigned which = input.u8();
    static constexpr std::array<const char*, 4> kDevices{"2-1", "4-1", "usb2", "usb3"};
    const std::string file =
        which >= 250 ? "sys/module/usbcore/parameters/usbfs_memory_mb" : tree.folder_of(kDevices[which % 4]) + "/" + kOfDevice[which / 4 % kOfDevice.size()];
    if (!std::filesystem::is_regular_file(tree.root() / file)) continue;
    before.emplace_back(file, tree.get(file));
    tree.set(file, text(input.bytes(input.u8())));
  }
  const auto topology = source->read();
  for (const auto& controller : topology.controllers)
    for (const auto& bus : controller.buses) require(std::isfinite(bus.reserved) && bus.reserved >= 0, "a bus's reservation is a number of bytes per second");
  for (const auto& device : topology.devices)
    for (const char c : device.serial + device.product_name)
      require(static_cast<unsigned char>(c) >= 0x20 && c != 0x7F, "no control characters leave the reader");
  for (auto it = before.rbegin(); it != before.rend(); ++it) std::ofstream(tree.root() / it->first, std::ios::binary) << it->second;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  switch (input.u8() % 3) {
    case 0:
      read_descriptors(input);
      break;
    case 1:
      read_names(input);
      break;
    default:
      read_tree(input);
  }
  return 0;
}
