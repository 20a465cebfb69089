// A tree that looks like /sys and /dev of a machine with USB controllers and sensors, for tests to plant and to break.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {

struct PlantedController {
  std::string address = "0000:00:14.0";  ///< of PCI
  std::string vendor = "0x8086", device = "0xa36d", driver = "xhci_hcd";
  int first_bus = 1;                       ///< USB 2; the SuperSpeed bus has the next number
  std::string link_width{}, link_speed{};  ///< empty: built in, no attributes
  std::vector<std::string> switches{};     ///< PCI functions between the root and this one, outermost first
  std::string switch_width = "4", switch_speed = "5.0 GT/s PCIe";
  bool dead = false;  ///< bound, but without buses
};

struct PlantedSensor {
  std::string serial = "000000000001";
  std::string speed = "5000";
  bool streaming = false, audio = false, autosuspend = false, node = true;
};

class PlantedSysfs {
 public:
  PlantedSysfs() { make("sys/bus/usb/devices"), make("sys/bus/pci/devices"), set("sys/module/usbcore/parameters/usbfs_memory_mb", "16"); }

  std::filesystem::path root() const { return folder_.path; }
  std::filesystem::path set(const std::string& file, const std::string& text) const { return folder_.write(file, text + "\n"); }
  std::string get(const std::string& file) const { return read_text(folder_.path / file); }
  void make(const std::string& folder) const { std::filesystem::create_directories(folder_.path / folder); }
  /// `target` is named from the root.
  void link(const std::string& from, const std::string& target) const {
    const auto place = folder_.path / from;
    std::filesystem::create_directories(place.parent_path());
    std::filesystem::remove(place);
    std::filesystem::create_symlink(std::filesystem::relative(folder_.path / target, place.parent_path()), place);
  }

  void controller(const PlantedController& c);
  /// A Kinect v2 at "BUS-PORT"; streaming: alternate setting 1 is active and the stream interface claimed.
  void sensor(const std::string& path, const PlantedSensor& s);
  /// A device of any kind.
  void device(const std::string& path, const std::string& vendor, const std::string& product, const std::string& name, const std::string& speed);
  /// The folder of a planted device, from the root: "sys/devices/...".
  std::string folder_of(const std::string& path) const;

 private:
  void root_hub(const std::string& parent, int bus, const std::string& speed);
  TemporaryFolder folder_;
};

/// The Kinect v2's descriptors (18 and 109 bytes), as the kernel's file has them.
std::string sensor_descriptors();

}  // namespace booth::tests
