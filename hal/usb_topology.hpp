// What hangs on which USB controller, as plain values: the picture by which cameras are placed, doctored and rescued.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace booth::hal {

/// In the order of their speeds; numbers are the signalling rate.
enum class UsbSpeed : std::uint8_t { unknown, low_1_5, full_12, high_480, super_5000, super_10000, super_20000 };

constexpr bool is_super(UsbSpeed s) { return s >= UsbSpeed::super_5000; }
/// Megabits per second on the wire; 0 where it is not known.
constexpr double megabits(UsbSpeed s) {
  switch (s) {
    case UsbSpeed::low_1_5:
      return 1.5;
    case UsbSpeed::full_12:
      return 12;
    case UsbSpeed::high_480:
      return 480;
    case UsbSpeed::super_5000:
      return 5'000;
    case UsbSpeed::super_10000:
      return 10'000;
    case UsbSpeed::super_20000:
      return 20'000;
    case UsbSpeed::unknown:
      break;
  }
  return 0;
}

/// One bus of a controller: an xHCI controller has one for USB 2 and one for SuperSpeed. What Linux shows as a bus is what a camera's reservation is made on;
/// a controller that has several SuperSpeed instances inside one bus does not say so.
struct UsbBus {
  int number = 0;
  UsbSpeed speed = UsbSpeed::unknown;
  int ports = 0;
  /// Periodic bandwidth that the active alternate settings of its devices reserve, bytes per second (USB 3.1 section 9.6.7, wBytesPerInterval; USB 2.0
  /// section 9.6.6 for slower devices).
  double reserved = 0;
};

/// One hop between a controller and the processor.
struct PcieLink {
  std::string address{};                  ///< of the PCI function at its lower end, "0000:03:00.0"
  int width = 0, widest = 0;              ///< lanes now, and at best; 0: not a PCIe link (built into the chipset)
  double gigatransfers = 0, fastest = 0;  ///< per lane and second now, and at best
  /// What it carries after line coding, bytes per second (8b/10b below 8 GT/s, 128b/130b from there); 0 where it is not known.
  double capacity() const { return width * gigatransfers * (gigatransfers < 7.9 ? 0.8 : 128.0 / 130.0) * 1e9 / 8; }
};

struct UsbController {
  std::string id{};  ///< PCI address "0000:03:00.0", or the name of a platform device
  bool on_pci = false;
  std::uint16_t vendor = 0, device = 0;  ///< of PCI; 0 elsewhere
  std::string vendor_name{};             ///< readable, "unknown" where the table has none
  std::string driver;                    ///< "xhci_hcd"; empty: bound to none
  std::vector<UsbBus> buses{};           ///< none although it has a driver: it has died
  std::vector<PcieLink> links{};         ///< nearest to the controller first
  bool may_rebind = false;               ///< this process may unbind it from its driver and bind it again
};

struct UsbInterface {
  int number = 0, alternate = 0;
  std::uint8_t device_class = 0;
  std::string driver{};  ///< "usbfs" while a program has claimed it; empty: none
  double reserved = 0;   ///< bytes per second
};

struct UsbDevice {
  std::string path{};  ///< the kernel's name of its port, "2-1.3"; "usb2" for the root of bus 2
  int bus = 0, address = 0;
  std::uint16_t vendor = 0, product = 0;
  std::uint8_t device_class = 0;
  std::string product_name{}, serial{};  ///< as the device says, control characters removed; empty where it says nothing
  UsbSpeed speed = UsbSpeed::unknown;
  std::string controller{};  ///< UsbController::id; empty where it could not be told
  int configuration = 0;     ///< 0: the kernel did not configure it
  std::vector<UsbInterface> interfaces{};
  bool stays_awake = false;      ///< power/control is "on": the kernel does not suspend it
  std::string runtime_status{};  ///< "active", "suspended", empty where not known

  std::string node{};                          ///< "/dev/bus/usb/002/005"
  bool node_exists = false, may_open = false;  ///< whether this process may read and write it
  unsigned node_mode = 0;                      ///< permission bits
  std::string node_group{};                    ///< by name, by number where it has none

  bool port_switch = false, may_switch_port = false;  ///< whether the kernel can switch its port off and on, and whether this process may ask for it
};

/// Everything read at one moment.
struct UsbTopology {
  bool available = false;                  ///< the kernel has USB at all
  std::optional<int> usbfs_memory_mb;      ///< the limit on what all programs together have in flight, MiB; 0: none; empty: not readable
  std::vector<UsbController> controllers;  ///< by id
  std::vector<UsbDevice> devices;          ///< by path, root hubs included
  std::vector<std::string> remarks;        ///< what could not be read or believed, one sentence each
};

/// Reads the machine. Thread-safe; never throws for what it finds there.
class UsbTopologySource {
 public:
  virtual ~UsbTopologySource() = default;
  virtual UsbTopology read() const = 0;
};

inline const UsbDevice* find_device(const UsbTopology& t, const std::string& path) {
  for (const UsbDevice& d : t.devices)
    if (d.path == path) return &d;
  return nullptr;
}

inline const UsbController* find_controller(const UsbTopology& t, const std::string& id) {
  for (const UsbController& c : t.controllers)
    if (c.id == id) return &c;
  return nullptr;
}

inline const UsbController* controller_of_bus(const UsbTopology& t, int bus) {
  for (const UsbController& c : t.controllers)
    for (const UsbBus& b : c.buses)
      if (b.number == bus) return &c;
  return nullptr;
}

/// Devices that share a SuperSpeed bus: a reservation of one is room that the others do not have. Groups of two and more, in the order of the first.
inline std::vector<std::vector<const UsbDevice*>> sharing_a_bus(const std::vector<const UsbDevice*>& devices) {
  std::vector<std::vector<const UsbDevice*>> groups, out;
  for (const UsbDevice* d : devices) {
    if (!is_super(d->speed)) continue;
    bool placed = false;
    for (auto& group : groups)
      if (group.front()->bus == d->bus) {
        group.push_back(d);
        placed = true;
      }
    if (!placed) groups.push_back({d});
  }
  for (auto& group : groups)
    if (group.size() > 1) out.push_back(std::move(group));
  return out;
}

}  // namespace booth::hal
