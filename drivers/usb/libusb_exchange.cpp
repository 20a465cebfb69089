// One transfer with its own buffer: who waits may give up, the transfer may not.
#include "drivers/usb/libusb_exchange.hpp"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <vector>

#include "drivers/usb/libusb_errors.hpp"

namespace booth::drivers::usb {
namespace {

struct Exchange {
  std::shared_ptr<Handle> device;
  std::vector<unsigned char> buffer;
  libusb_transfer* transfer = libusb_alloc_transfer(0);
  std::mutex mutex;
  std::condition_variable landed;
  bool back = false;
  std::shared_ptr<Exchange> self;  ///< while it flies

  Exchange() = default;
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;
  ~Exchange() { libusb_free_transfer(transfer); }

  static void LIBUSB_CALL called_back(libusb_transfer* transfer) {
    auto& exchange = *static_cast<Exchange*>(transfer->user_data);
    std::shared_ptr<Exchange> last;  // outlives the lock
    const std::lock_guard lock(exchange.mutex);
    exchange.back = true;
    last = std::move(exchange.self);
    exchange.landed.notify_all();
  }
  ExchangeResult run(const std::shared_ptr<Exchange>& me, hal::Nanoseconds timeout);
};

unsigned milliseconds(hal::Nanoseconds t) {
  return static_cast<unsigned>(std::clamp<std::int64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(t).count(), 1, 3'600'000));
}

ExchangeResult Exchange::run(const std::shared_ptr<Exchange>& me, hal::Nanoseconds timeout) {
  std::unique_lock lock(mutex);
  self = me;
  errno = 0;
  if (const int code = libusb_submit_transfer(transfer); code != LIBUSB_SUCCESS) {
    self.reset();
    const int system_error = errno;
    return {code, system_error, code == LIBUSB_ERROR_NO_DEVICE ? Status::no_device : Status::error, 0};
  }
  const auto is_back = [this] { return back; };
  if (!landed.wait_for(lock, timeout + kExchangeGrace, is_back)) {
    (void)libusb_cancel_transfer(transfer);
    if (!landed.wait_for(lock, kExchangeGrace, is_back)) {
      device->wedged = true;
      return {LIBUSB_SUCCESS, 0, Status::timed_out, 0};
    }
  }
  const Status status = transfer->status == LIBUSB_TRANSFER_CANCELLED ? Status::timed_out : status_of(transfer->status);
  return {LIBUSB_SUCCESS, 0, status, static_cast<std::size_t>(std::max(transfer->actual_length, 0))};
}

std::shared_ptr<Exchange> make_exchange(const std::shared_ptr<Handle>& device, std::size_t bytes) {
  auto exchange = std::make_shared<Exchange>();
  if (exchange->transfer == nullptr) throw Error(Fault::no_memory, "no memory for a USB transfer");
  exchange->device = device;
  exchange->buffer.resize(bytes);
  return exchange;
}

}  // namespace

ExchangeResult exchange_bulk(const std::shared_ptr<Handle>& device, std::uint8_t endpoint, std::span<unsigned char> data, hal::Nanoseconds timeout) {
  if (device->wedged) return {LIBUSB_ERROR_IO, 0, Status::error, 0};
  const auto exchange = make_exchange(device, data.size());
  const bool in = (endpoint & LIBUSB_ENDPOINT_IN) != 0;
  if (!in) std::copy(data.begin(), data.end(), exchange->buffer.begin());
  libusb_fill_bulk_transfer(exchange->transfer, device->handle, endpoint, exchange->buffer.data(), static_cast<int>(data.size()), Exchange::called_back,
                            exchange.get(), milliseconds(timeout));
  ExchangeResult result = exchange->run(exchange, timeout);
  result.bytes = std::min(result.bytes, data.size());
  if (in && result.bytes > 0) std::copy_n(exchange->buffer.begin(), result.bytes, data.begin());
  return result;
}

ExchangeResult exchange_control(const std::shared_ptr<Handle>& device, const ControlRequest& r, std::span<const std::byte> data, hal::Nanoseconds timeout) {
  if (device->wedged) return {LIBUSB_ERROR_IO, 0, Status::error, 0};
  if (data.size() > 0xFFFF) throw Error(Fault::unsupported, "a control request carries at most 65535 bytes");
  const auto exchange = make_exchange(device, LIBUSB_CONTROL_SETUP_SIZE + data.size());
  libusb_fill_control_setup(exchange->buffer.data(), r.type, r.request, r.value, r.index, static_cast<std::uint16_t>(data.size()));
  if (!data.empty()) std::memcpy(exchange->buffer.data() + LIBUSB_CONTROL_SETUP_SIZE, data.data(), data.size());
  libusb_fill_control_transfer(exchange->transfer, device->handle, exchange->buffer.data(), Exchange::called_back, exchange.get(), milliseconds(timeout));
  return exchange->run(exchange, timeout);
}

}  // namespace booth::drivers::usb
