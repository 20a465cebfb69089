// The real bus, through libusb.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "drivers/usb/usb.hpp"

namespace booth::drivers::usb {

/// One message of libusb's own. Called by any thread, at most once a second; must not call libusb.
using LibusbLog = std::function<void(bool error, const std::string& text)>;

/// Throws Error when libusb cannot be initialised. Devices and streams keep what they need of it alive. `root` is where /sys is found, for the serials
/// that the kernel has read already.
std::shared_ptr<Bus> make_libusb_bus(LibusbLog log = {}, std::filesystem::path root = "/");

}  // namespace booth::drivers::usb
