// Writes the few attributes that boothd reads.
#include "tests/drivers/usb/planted_sysfs.hpp"

#include <cstdio>

namespace booth::tests {
namespace {

std::string three(int n) {
  char out[16];
  std::snprintf(out, sizeof out, "%03d", n);
  return out;
}

int bus_of(const std::string& path) { return std::stoi(path.starts_with("usb") ? path.substr(3) : path); }

std::string interface_name(const std::string& path, int number) {
  return (path.starts_with("usb") ? path.substr(3) + "-0" : path) + ":1." + std::to_string(number);
}

}  // namespace

std::string sensor_descriptors() {
  static constexpr unsigned char kBytes[] = {
      0x12, 0x01, 0x00, 0x03, 0xEF, 0x02, 0x01, 0x09, 0x5E, 0x04, 0xC4, 0x02, 0x00, 0x01, 0x01, 0x02, 0x03, 0x01,  // device
      0x09, 0x02, 0x6D, 0x00, 0x02, 0x01, 0x00, 0xC0, 0x12, 0x08, 0x0B, 0x00, 0x02, 0xFF, 0xFF, 0x00, 0x00,        // configuration 1
      0x09, 0x04, 0x00, 0x00, 0x04, 0xFF, 0x00, 0x00, 0x00,                                                        // interface 0
      0x07, 0x05, 0x81, 0x02, 0x00, 0x04, 0x00, 0x06, 0x30, 0x0F, 0x00, 0x00, 0x00,                                // bulk
      0x07, 0x05, 0x02, 0x02, 0x00, 0x04, 0x00, 0x06, 0x30, 0x0F, 0x00, 0x00, 0x00,                                // bulk
      0x07, 0x05, 0x83, 0x02, 0x00, 0x04, 0x00, 0x06, 0x30, 0x0F, 0x00, 0x00, 0x00,                                // bulk
      0x07, 0x05, 0x82, 0x03, 0x40, 0x00, 0x08, 0x06, 0x30, 0x00, 0x00, 0x40, 0x00,                                // interrupt, 64 bytes in 16 ms
      0x09, 0x04, 0x01, 0x00, 0x00, 0xFF, 0x00, 0x00, 0x00,                                                        // interface 1
      0x09, 0x04, 0x01, 0x01, 0x01, 0xFF, 0x00, 0x00, 0x00, 0x07, 0x05, 0x84, 0x05, 0x00, 0x04, 0x01, 0x06, 0x30, 0x0A, 0x02, 0x00, 0x84};  // isochronous
  return {reinterpret_cast<const char*>(kBytes), sizeof kBytes};
}

std::string PlantedSysfs::folder_of(const std::string& path) const {
  const auto real = std::filesystem::canonical(folder_.path / "sys/bus/usb/devices" / path);
  return std::filesystem::relative(real, std::filesystem::canonical(folder_.path)).string();
}

void PlantedSysfs::root_hub(const std::string& parent, int bus, const std::string& speed) {
  const std::string name = "usb" + std::to_string(bus), folder = parent + "/" + name;
  make(folder);
  link("sys/bus/usb/devices/" + name, folder);
  for (const auto& [file, text] : {std::pair<std::string, std::string>{"busnum", std::to_string(bus)},
                                   {"devnum", "1"},
                                   {"idVendor", "1d6b"},
                                   {"idProduct", speed == "480" ? "0002" : "0003"},
                                   {"bDeviceClass", "09"},
                                   {"product", "xHCI Host Controller"},
                                   {"speed", speed},
                                   {"bConfigurationValue", "1"},
                                   {"maxchild", "8"},
                                   {"power/control", "auto"}})
    set(folder + "/" + file, text);
  const std::string interface = folder + "/" + interface_name(name, 0);
  set(interface + "/bInterfaceNumber", "00");
  set(interface + "/bInterfaceClass", "09");
  set(interface + "/bAlternateSetting", " 0");
  for (int port = 1; port <= 8; ++port) set(interface + "/" + name + "-port" + std::to_string(port) + "/disable", "0");
  set("dev/bus/usb/" + three(bus) + "/001", "");
}

void PlantedSysfs::controller(const PlantedController& c) {
  std::string folder = "sys/devices/pci0000:00";
  for (const auto& bridge : c.switches) {
    folder += "/" + bridge;
    set(folder + "/current_link_width", c.switch_width);
    set(folder + "/max_link_width", "4");
    set(folder + "/current_link_speed", c.switch_speed);
    set(folder + "/max_link_speed", "5.0 GT/s PCIe");
  }
  folder += "/" + c.address;
  set(folder + "/vendor", c.vendor);
  set(folder + "/device", c.device);
  set(folder + "/class", "0x0c0330");
  if (!c.link_width.empty()) {
    set(folder + "/current_link_width", c.link_width);
    set(folder + "/max_link_width", "1");
    set(folder + "/current_link_speed", c.link_speed);
    set(folder + "/max_link_speed", "5.0 GT/s PCIe");
  }
  link("sys/bus/pci/devices/" + c.address, folder);
  if (!c.driver.empty()) {
    set("sys/bus/pci/drivers/" + c.driver + "/bind", "");
    set("sys/bus/pci/drivers/" + c.driver + "/unbind", "");
    link(folder + "/driver", "sys/bus/pci/drivers/" + c.driver);
  }
  if (c.dead || c.driver.empty()) return;
  root_hub(folder, c.first_bus, "480");
  root_hub(folder, c.first_bus + 1, "5000");
}

void PlantedSysfs::device(const std::string& path, const std::string& vendor, const std::string& product, const std::string& name, const std::string& speed) {
  const auto dot = path.rfind('.');
  const int bus = bus_of(path);
  const std::string above = dot == std::string::npos ? "usb" + std::to_string(bus) : path.substr(0, dot);
  const std::string folder = folder_of(above) + "/" + path;
  make(folder);
  link("sys/bus/usb/devices/" + path, folder);
  const int address = 2 + static_cast<int>(std::hash<std::string>()(path) % 120);
  for (const auto& [file, text] : {std::pair<std::string, std::string>{"busnum", std::to_string(bus)},
                                   {"devnum", std::to_string(address)},
                                   {"idVendor", vendor},
                                   {"idProduct", product},
                                   {"bDeviceClass", "ef"},
                                   {"product", name},
                                   {"speed", speed},
                                   {"bConfigurationValue", "1"},
                                   {"power/control", "on"},
                                   {"power/runtime_status", "active"}})
    set(folder + "/" + file, text);
  set("dev/bus/usb/" + three(bus) + "/" + three(address), "");
}

void PlantedSysfs::sensor(const std::string& path, const PlantedSensor& s) {
  device(path, "045e", "02c4", "Xbox NUI Sensor", s.speed);
  const std::string folder = folder_of(path);
  set(folder + "/serial", s.serial);
  set(folder + "/power/control", s.autosuspend ? "auto" : "on");
  folder_.write(folder + "/descriptors", sensor_descriptors());
  for (int number = 0; number < (s.audio ? 4 : 2); ++number) {
    const std::string interface = folder + "/" + interface_name(path, number);
    set(interface + "/bInterfaceNumber", "0" + std::to_string(number));
    set(interface + "/bInterfaceClass", number < 2 ? "ff" : "01");
    set(interface + "/bAlternateSetting", number == 1 && s.streaming ? " 1" : " 0");
    if (number < 2 && s.streaming) link(interface + "/driver", "sys/bus/usb/drivers/usbfs");
    if (number >= 2) link(interface + "/driver", "sys/bus/usb/drivers/snd-usb-audio");
  }
  if (!s.node) {
    std::string address = get(folder + "/devnum");
    address.pop_back();
    std::filesystem::remove(folder_.path / "dev/bus/usb" / three(bus_of(path)) / three(std::stoi(address)));
  }
}

}  // namespace booth::tests
