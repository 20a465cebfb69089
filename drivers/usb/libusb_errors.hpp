// From libusb's codes and the kernel's errno to faults, and to sentences that say what to do.
#pragma once

#include <libusb-1.0/libusb.h>

#include <string>

#include "drivers/usb/usb.hpp"

namespace booth::drivers::usb {

/// libusb folds most of the kernel's answers into "other" or "input/output error"; errno of the same call, read at once, still knows better. 0: not known.
Fault fault_of(int code, int system_error = 0);

/// `what` names the device and the request. Throws Error with reason and remedy.
[[noreturn]] void fail(int code, int system_error, const std::string& what);

Status status_of(libusb_transfer_status status);
Speed speed_of(int speed);

}  // namespace booth::drivers::usb
