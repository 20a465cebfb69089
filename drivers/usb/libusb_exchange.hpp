// A bulk or control transfer that is waited for, within bounds that hold even when the controller has died.
#pragma once

#include <chrono>
#include <memory>
#include <span>

#include "drivers/usb/libusb_context.hpp"
#include "drivers/usb/usb.hpp"

namespace booth::drivers::usb {

struct ExchangeResult {
  int code = 0;  ///< libusb's, where it could not be submitted
  int system_error = 0;
  Status status = Status::error;
  std::size_t bytes = 0;
};

/// libusb's own blocking calls wait without end for a cancelled transfer, and handle the context's events on the caller's thread meanwhile. This waits for
/// the event thread, at most `timeout` and twice kExchangeGrace; what has not come back then stays in memory until it does, and the handle is wedged.
inline constexpr std::chrono::milliseconds kExchangeGrace(500);

/// `data` goes out or is filled, by the direction bit of the endpoint. Not on the event thread.
ExchangeResult exchange_bulk(const std::shared_ptr<Handle>& device, std::uint8_t endpoint, std::span<unsigned char> data, hal::Nanoseconds timeout);
/// Host to device.
ExchangeResult exchange_control(const std::shared_ptr<Handle>& device, const ControlRequest& request, std::span<const std::byte> data,
                                hal::Nanoseconds timeout);

}  // namespace booth::drivers::usb
