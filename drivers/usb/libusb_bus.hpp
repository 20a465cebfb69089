// The real bus, through libusb.
#pragma once

#include <memory>

#include "drivers/usb/usb.hpp"

namespace booth::drivers::usb {

/// Throws Error when libusb cannot be initialised. Devices and streams keep what they need of it alive.
std::shared_ptr<Bus> make_libusb_bus();

}  // namespace booth::drivers::usb
