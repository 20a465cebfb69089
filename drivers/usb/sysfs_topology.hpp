// The Linux implementation of hal::UsbTopologySource: /sys and /dev, or a tree that looks like them.
#pragma once

#include <filesystem>
#include <memory>

#include "drivers/usb/sysfs.hpp"
#include "drivers/usb/usb_names.hpp"
#include "hal/usb_topology.hpp"

namespace booth::drivers::usb {

/// `root` stands for "/". Reading needs no privileges; what could not be read is a remark of the result.
std::unique_ptr<hal::UsbTopologySource> make_sysfs_topology(std::filesystem::path root = "/");

/// The attribute by which the kernel (6.0 and later) switches a port off and on; nothing when it has none.
std::optional<std::filesystem::path> port_switch(const Sysfs& sysfs, const PortName& port);

/// Folder of a driver of PCI functions, by name.
std::filesystem::path pci_driver_folder(const std::string& driver);

}  // namespace booth::drivers::usb
