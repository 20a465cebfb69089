// The bus and its devices through libusb.
#include "drivers/usb/libusb_bus.hpp"

#include <libusb-1.0/libusb.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <mutex>

#include "drivers/usb/libusb_context.hpp"
#include "drivers/usb/libusb_errors.hpp"
#include "drivers/usb/libusb_exchange.hpp"
#include "drivers/usb/libusb_stream.hpp"
#include "drivers/usb/sysfs.hpp"
#include "drivers/usb/usb_names.hpp"

namespace booth::drivers::usb {
namespace {

/// Runs one call of libusb and keeps the errno that it leaves behind.
template <class Call>
std::pair<int, int> with_errno(Call call) {
  errno = 0;
  const int code = call();
  return {code, errno};
}

class LibusbDevice final : public Device {
 public:
  LibusbDevice(std::shared_ptr<Handle> handle, DeviceInfo info) : handle_(std::move(handle)), info_(std::move(info)) {}

  const DeviceInfo& info() const override { return info_; }
  int configuration() override {
    int value = 0;
    check(with_errno([&] { return libusb_get_configuration(handle_->handle, &value); }), "reading the configuration");
    return value;
  }
  void set_configuration(int value) override {
    check(with_errno([&] { return libusb_set_configuration(handle_->handle, value); }), "setting the configuration");
  }
  void claim(int interface) override {
    check(with_errno([&] { return libusb_claim_interface(handle_->handle, interface); }), "claiming interface " + std::to_string(interface));
  }
  void release(int interface) noexcept override { (void)libusb_release_interface(handle_->handle, interface); }
  void set_alternate(int interface, int alternate) override {
    auto result = choose(interface, alternate);
    // xHCI refuses a reservation with ENOSPC (bandwidth) or ENOMEM (its own tables are full); both mean one camera too many on this controller.
    if (result.second == ENOMEM) result.second = ENOSPC;
    check(result, "choosing alternate setting " + std::to_string(alternate) + " of interface " + std::to_string(interface));
  }
  std::size_t bytes_per_interval(int interface, int alternate, std::uint8_t endpoint) override;
  void control_out(const ControlRequest& r, std::span<const std::byte> data, hal::Nanoseconds timeout) override {
    const std::string what = name() + ": control request " + std::to_string(r.request);
    const auto done = exchange_control(handle_, r, data, timeout);
    if (done.code != LIBUSB_SUCCESS) fail(done.code, done.system_error, what);
    switch (done.status) {
      case Status::completed:
        return;
      case Status::timed_out:
        fail(LIBUSB_ERROR_TIMEOUT, 0, what);
      case Status::stalled:
        fail(LIBUSB_ERROR_PIPE, 0, what);
      case Status::no_device:
        fail(LIBUSB_ERROR_NO_DEVICE, 0, what);
      default:
        fail(LIBUSB_ERROR_IO, 0, what);
    }
  }
  TransferResult bulk_out(std::uint8_t endpoint, std::span<const std::byte> data, hal::Nanoseconds timeout) override {
    // The exchange sends a copy; what it takes as writable it leaves alone.
    return bulk(endpoint, const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(data.data())), data.size(), timeout);
  }
  TransferResult bulk_in(std::uint8_t endpoint, std::span<std::byte> data, hal::Nanoseconds timeout) override {
    return bulk(endpoint, reinterpret_cast<unsigned char*>(data.data()), data.size(), timeout);
  }
  void reset() override {
    check(with_errno([&] { return libusb_reset_device(handle_->handle); }), "the bus reset");
  }
  std::unique_ptr<Stream> open_stream(const StreamSettings& settings, StreamSink& sink) override { return open_libusb_stream(handle_, settings, sink, name()); }

 private:
  std::pair<int, int> choose(int interface, int alternate) const;
  std::string name() const { return "USB device " + info_.serial + " at port " + info_.path; }
  void check(std::pair<int, int> result, const std::string& what) const {
    if (result.first != LIBUSB_SUCCESS) fail(result.first, result.second, name() + ": " + what);
  }
  TransferResult bulk(std::uint8_t endpoint, unsigned char* data, std::size_t size, hal::Nanoseconds timeout) {
    const auto done = exchange_bulk(handle_, endpoint, {data, size}, timeout);
    // The kernel's limit of memory for USB is no news of the transfer: without its name nobody would find the remedy.
    if (done.code == LIBUSB_ERROR_NO_MEM) fail(done.code, done.system_error, name() + ": a transfer of " + std::to_string(size) + " bytes");
    return {done.status, done.bytes};
  }

  const std::shared_ptr<Handle> handle_;
  const DeviceInfo info_;
};

/// Asks the kernel itself. libusb_set_interface_alt_setting of libusb 1.0.26 (Debian 12's) unlocks the handle's mutex without having locked it when the device
/// has left the bus, and libusb_close then aborts the process. The device's file is the only one of its context that is polled for writing; libusb takes it
/// out when the device is gone.
std::pair<int, int> LibusbDevice::choose(int interface, int alternate) const {
  int file = -1;
  const libusb_pollfd** polled = libusb_get_pollfds(handle_->context->get());
  for (const libusb_pollfd** p = polled; p != nullptr && *p != nullptr; ++p)
    if (((*p)->events & POLLOUT) != 0) file = (*p)->fd;
  libusb_free_pollfds(polled);
  if (file < 0) return {LIBUSB_ERROR_NO_DEVICE, ENODEV};
  usbdevfs_setinterface request{.interface = static_cast<unsigned>(interface), .altsetting = static_cast<unsigned>(alternate)};
  if (::ioctl(file, USBDEVFS_SETINTERFACE, &request) == 0) return {LIBUSB_SUCCESS, 0};
  const int error = errno;
  return {error == EINVAL ? LIBUSB_ERROR_NOT_FOUND : error == ENODEV || error == ESHUTDOWN ? LIBUSB_ERROR_NO_DEVICE : LIBUSB_ERROR_OTHER, error};
}

std::size_t LibusbDevice::bytes_per_interval(int interface, int alternate, std::uint8_t endpoint) {
  libusb_config_descriptor* config = nullptr;
  // Of the configuration that the device is in: another one's alternate settings say nothing of this one's.
  check(with_errno([&] { return libusb_get_active_config_descriptor(libusb_get_device(handle_->handle), &config); }), "reading its descriptors");
  std::size_t bytes = 0;
  for (int i = 0; i < config->bNumInterfaces; ++i)
    for (int a = 0; a < config->interface[i].num_altsetting; ++a) {
      const auto& setting = config->interface[i].altsetting[a];
      if (setting.bInterfaceNumber != interface || setting.bAlternateSetting != alternate) continue;
      for (int e = 0; e < setting.bNumEndpoints; ++e) {
        const auto& found = setting.endpoint[e];
        if (found.bEndpointAddress != endpoint || (found.bmAttributes & 3) != LIBUSB_TRANSFER_TYPE_ISOCHRONOUS) continue;
        libusb_ss_endpoint_companion_descriptor* companion = nullptr;
        if (libusb_get_ss_endpoint_companion_descriptor(handle_->context->get(), &found, &companion) != LIBUSB_SUCCESS) continue;
        bytes = companion->wBytesPerInterval;
        libusb_free_ss_endpoint_companion_descriptor(companion);
      }
    }
  libusb_free_config_descriptor(config);
  return bytes;
}

/// Devices of a context, with what is known of them unopened. The list is freed with the object.
class DeviceList {
 public:
  explicit DeviceList(libusb_context* context) : count_(libusb_get_device_list(context, &list_)) {}
  ~DeviceList() {
    if (count_ >= 0) libusb_free_device_list(list_, 1);
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  std::span<libusb_device*> all() const { return {list_, static_cast<std::size_t>(std::max<ssize_t>(0, count_))}; }

 private:
  libusb_device** list_ = nullptr;
  ssize_t count_;
};

class LibusbBus final : public Bus {
 public:
  explicit LibusbBus(std::filesystem::path root) : sysfs_(std::move(root)) {
    constexpr int kEvents = LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT;
    if (libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) != 0)
      hotplug_ = libusb_hotplug_register_callback(context_.get(), kEvents, 0, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
                                                  changed, this, nullptr) == LIBUSB_SUCCESS;
    context_.handle_events("usb events");
  }
  std::vector<DeviceInfo> list(std::span<const std::pair<std::uint16_t, std::uint16_t>> ids) override;
  std::unique_ptr<Device> open(const DeviceInfo& info) override;
  std::uint64_t changes() const override;

 private:
  static int LIBUSB_CALL changed(libusb_context*, libusb_device*, libusb_hotplug_event, void* bus) {
    ++static_cast<LibusbBus*>(bus)->changes_;
    return 0;
  }
  std::string serial_of(libusb_device* device, const libusb_device_descriptor& descriptor, const DeviceInfo& info) const;

  const Sysfs sysfs_;
  bool hotplug_ = false;
  mutable std::atomic<std::uint64_t> changes_{0};
  mutable std::mutex seen_mutex_;
  mutable std::vector<int> seen_;
  Context context_;  // the last member: its thread counts changes
};

std::uint64_t LibusbBus::changes() const {
  if (hotplug_) return changes_;
  // Nobody tells us: look, and compare with what was seen last.
  std::vector<int> now;
  const DeviceList devices(context_.get());
  for (libusb_device* d : devices.all()) now.push_back(libusb_get_bus_number(d) << 8 | libusb_get_device_address(d));
  std::sort(now.begin(), now.end());
  const std::lock_guard lock(seen_mutex_);
  if (now != seen_) ++changes_;
  seen_ = std::move(now);
  return changes_;
}

DeviceInfo describe(libusb_device* device, const libusb_device_descriptor& descriptor) {
  DeviceInfo info{.vendor = descriptor.idVendor,
                  .product = descriptor.idProduct,
                  .speed = speed_of(libusb_get_device_speed(device)),
                  .bus = libusb_get_bus_number(device),
                  .address = libusb_get_device_address(device),
                  .path = std::to_string(libusb_get_bus_number(device)),
                  .serial = {}};
  std::array<std::uint8_t, 8> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  for (int i = 0; i < depth; ++i) info.path += (i == 0 ? "-" : ".") + std::to_string(ports[static_cast<std::size_t>(i)]);
  return info;
}

std::string LibusbBus::serial_of(libusb_device* device, const libusb_device_descriptor& descriptor, const DeviceInfo& info) const {
  // The kernel read it when it enumerated. Asking the device itself would wake it, and wait a second for each one that hangs.
  const std::filesystem::path folder = std::filesystem::path("sys/bus/usb/devices") / info.path;
  if (parse_port_name(info.path) && sysfs_.number(folder / "devnum").value_or(-1) == info.address)
    if (const auto known = sysfs_.text(folder / "serial"); known && !known->empty()) return *known;
  libusb_device_handle* handle = nullptr;
  if (descriptor.iSerialNumber == 0 || libusb_open(device, &handle) != LIBUSB_SUCCESS) return "";
  std::array<unsigned char, 128> text{};
  const int n = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(), static_cast<int>(text.size()));
  libusb_close(handle);
  return n > 0 ? std::string(reinterpret_cast<const char*>(text.data()), std::min(static_cast<std::size_t>(n), text.size())) : "";
}

std::vector<DeviceInfo> LibusbBus::list(std::span<const std::pair<std::uint16_t, std::uint16_t>> ids) {
  std::vector<DeviceInfo> out;
  const DeviceList devices(context_.get());
  for (libusb_device* device : devices.all()) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(device, &descriptor) != LIBUSB_SUCCESS) continue;
    if (std::find(ids.begin(), ids.end(), std::pair(descriptor.idVendor, descriptor.idProduct)) == ids.end()) continue;
    DeviceInfo info = describe(device, descriptor);
    info.serial = serial_of(device, descriptor, info);
    out.push_back(std::move(info));
  }
  std::sort(out.begin(), out.end(), [](const DeviceInfo& a, const DeviceInfo& b) { return a.path < b.path; });
  return out;
}

std::unique_ptr<Device> LibusbBus::open(const DeviceInfo& info) {
  auto handle = std::make_shared<Handle>();
  handle->context = std::make_shared<Context>();
  const DeviceList devices(handle->context->get());
  for (libusb_device* device : devices.all()) {
    if (libusb_get_bus_number(device) != info.bus || libusb_get_device_address(device) != info.address) continue;
    const auto [code, system_error] = with_errno([&] { return libusb_open(device, &handle->handle); });
    if (code != LIBUSB_SUCCESS) {
      handle->handle = nullptr;
      fail(code, system_error, "opening USB device " + info.serial + " at port " + info.path);
    }
    handle->context->handle_events("usb " + info.path);
    return std::make_unique<LibusbDevice>(std::move(handle), info);
  }
  fail(LIBUSB_ERROR_NO_DEVICE, 0, "USB device " + info.serial + " at port " + info.path);
}

}  // namespace

std::shared_ptr<Bus> make_libusb_bus(LibusbLog log, std::filesystem::path root) {
  if (log) set_libusb_log(std::move(log));
  return std::make_shared<LibusbBus>(std::move(root));
}

}  // namespace booth::drivers::usb
