// Which texts are names of ports and PCI functions: everything that becomes part of a path in sysfs is checked here first.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace booth::drivers::usb {

/// A device's port as the kernel names it: "2-1", "2-1.3", at most seven ports deep (USB 3.1 section 10.1: five hubs between root and device).
struct PortName {
  int bus = 0;
  std::string hub;  ///< the device above: "2-1", or "usb2" for a root
  int port = 0;     ///< of that hub
};

/// Nothing unless the whole text is such a name: digits, one dash, dots; no leading zeros, no number above 255.
std::optional<PortName> parse_port_name(std::string_view text);

/// "0000:03:00.0": domain of four (up to eight for some virtual machines), bus, slot, function.
bool is_pci_address(std::string_view text);

/// A driver that runs xHCI controllers.
bool is_xhci_driver(std::string_view name);

}  // namespace booth::drivers::usb
