// The tables, and one remedy for each fault.
#include "drivers/usb/libusb_errors.hpp"

#include <array>
#include <cerrno>
#include <system_error>

namespace booth::drivers::usb {
namespace {

const char* remedy(Fault fault) {
  switch (fault) {
    case Fault::access:
      return "; install systemd/90-boothd-kinect2.rules in /etc/udev/rules.d and plug the device in again";
    case Fault::no_device:
      return "; check its cable and its mains adaptor";
    case Fault::busy:
      return "; another program has claimed it, or it is connected at USB 2 speed";
    case Fault::stall:
      return "; it is probably connected at USB 2 speed: use a USB 3 port and the original cable";
    case Fault::no_memory:
      return "; raise usbcore.usbfs_memory_mb to 256 on the kernel's command line";
    case Fault::no_bandwidth:
      return "; its controller has no bandwidth left: give each camera a controller of its own";
    default:
      return "";
  }
}

}  // namespace

Fault fault_of(int code, int system_error) {
  switch (system_error) {
    case ENOSPC:
      return Fault::no_bandwidth;
    case ENOMEM:
      return Fault::no_memory;
    case ENODEV:
    case ESHUTDOWN:
      return Fault::no_device;
    case EACCES:
    case EPERM:
      return Fault::access;
    case EBUSY:
      return Fault::busy;
    case ETIMEDOUT:
      return Fault::timeout;
    case EPIPE:
      return Fault::stall;
    default:
      break;
  }
  switch (code) {
    case LIBUSB_ERROR_ACCESS:
      return Fault::access;
    case LIBUSB_ERROR_NO_DEVICE:
      return Fault::no_device;
    case LIBUSB_ERROR_NOT_FOUND:
      return Fault::not_found;
    case LIBUSB_ERROR_BUSY:
      return Fault::busy;
    case LIBUSB_ERROR_TIMEOUT:
      return Fault::timeout;
    case LIBUSB_ERROR_PIPE:
      return Fault::stall;
    case LIBUSB_ERROR_NO_MEM:
      return Fault::no_memory;
    case LIBUSB_ERROR_NOT_SUPPORTED:
      return Fault::unsupported;
    case LIBUSB_ERROR_IO:
      return Fault::io;
    default:
      return Fault::other;
  }
}

void fail(int code, int system_error, const std::string& what) {
  const Fault fault = fault_of(code, system_error);
  // A stale errno would be worse than none: it is named only where libusb itself has nothing to say.
  const bool vague = code == LIBUSB_ERROR_OTHER || code == LIBUSB_ERROR_IO;
  const std::string reason = vague && system_error != 0 ? std::generic_category().message(system_error) : libusb_strerror(static_cast<libusb_error>(code));
  throw Error(fault, what + ": " + reason + remedy(fault));
}

Status status_of(libusb_transfer_status status) {
  switch (status) {
    case LIBUSB_TRANSFER_COMPLETED:
      return Status::completed;
    case LIBUSB_TRANSFER_TIMED_OUT:
      return Status::timed_out;
    case LIBUSB_TRANSFER_CANCELLED:
      return Status::cancelled;
    case LIBUSB_TRANSFER_STALL:
      return Status::stalled;
    case LIBUSB_TRANSFER_NO_DEVICE:
      return Status::no_device;
    case LIBUSB_TRANSFER_OVERFLOW:
      return Status::overflow;
    default:
      return Status::error;
  }
}

Speed speed_of(int speed) {
  static constexpr std::array<Speed, 6> kSpeeds{Speed::unknown, Speed::low, Speed::full, Speed::high, Speed::super, Speed::super_plus};
  return speed >= 0 && speed < static_cast<int>(kSpeeds.size()) ? kSpeeds[static_cast<std::size_t>(speed)] : Speed::unknown;
}

}  // namespace booth::drivers::usb
