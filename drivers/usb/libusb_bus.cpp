// Contexts, handles and transfers of libusb, each owned by one object; one event thread for each opened device.
#include "drivers/usb/libusb_bus.hpp"

#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace booth::drivers::usb {
namespace {

using namespace std::chrono_literals;

Fault fault_of(int code) {
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

[[noreturn]] void fail(int code, const std::string& what) {
  const Fault fault = fault_of(code);
  throw Error(fault, what + ": " + libusb_strerror(static_cast<libusb_error>(code)) + remedy(fault));
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

hal::MonotonicTime monotonic_now() { return hal::MonotonicTime(std::chrono::steady_clock::now().time_since_epoch()); }
unsigned milliseconds(hal::Nanoseconds t) {
  return static_cast<unsigned>(std::max<std::int64_t>(1, std::chrono::duration_cast<std::chrono::milliseconds>(t).count()));
}

/// A context with a thread that handles its events. One for each opened device, so that a slow camera never holds up another's packets.
class Context {
 public:
  Context() {
    if (const int code = libusb_init(&context_); code != LIBUSB_SUCCESS) fail(code, "libusb cannot be initialised");
  }
  ~Context() {
    *stop_ = true;
    if (thread_.get_id() == std::this_thread::get_id()) {
      // The last owner was a transfer that called back long after everyone had given it up: the thread cannot wait for itself, and the context stays behind.
      thread_.detach();
      return;
    }
    if (thread_.joinable()) {
      libusb_interrupt_event_handler(context_);
      thread_.join();
    }
    libusb_exit(context_);
  }
  Context(const Context&) = delete;
  void handle_events() {
    thread_ = std::thread([context = context_, stop = stop_] {
      while (!*stop) {
        timeval tv{.tv_sec = 0, .tv_usec = 100'000};
        (void)libusb_handle_events_timeout_completed(context, &tv, nullptr);
      }
    });
  }
  libusb_context* get() const { return context_; }

 private:
  libusb_context* context_ = nullptr;
  const std::shared_ptr<std::atomic<bool>> stop_ = std::make_shared<std::atomic<bool>>(false);
  std::thread thread_;
};

/// The handle outlives its streams' last transfer, however late that calls back.
struct Handle {
  std::shared_ptr<Context> context;
  libusb_device_handle* handle = nullptr;
  ~Handle() {
    if (handle != nullptr) libusb_close(handle);
  }
};

/// The transfers of one stream. Callbacks run on the event thread and hold a reference by `self` until the last has come.
struct Pool {
  std::shared_ptr<Handle> device;
  StreamSettings settings;
  StreamSink* sink = nullptr;
  struct Slot {
    Pool* pool = nullptr;
    libusb_transfer* transfer = nullptr;
    unsigned char* memory = nullptr;
    bool kernel_memory = false;
    bool flying = false;
  };
  std::vector<Slot> slots;
  std::mutex mutex;
  std::condition_variable landed;
  int alive = 0;
  std::atomic<bool> stopping{false};
  bool ended = false;
  std::shared_ptr<Pool> self;  ///< set while transfers fly

  ~Pool() {
    for (Slot& s : slots) {
      if (s.transfer != nullptr) libusb_free_transfer(s.transfer);
      if (s.memory == nullptr) continue;
      if (s.kernel_memory) {
        libusb_dev_mem_free(device->handle, s.memory, bytes());
      } else {
        delete[] s.memory;
      }
    }
  }
  std::size_t bytes() const { return settings.packet_bytes * static_cast<std::size_t>(settings.isochronous ? settings.packets_per_transfer : 1); }
  void fill(Slot& slot);
  int submit();
  void deliver(const libusb_transfer& transfer);
  static void LIBUSB_CALL called_back(libusb_transfer* transfer);
};

void Pool::fill(Slot& slot) {
  const int packets = settings.isochronous ? settings.packets_per_transfer : 0;
  slot.pool = this;
  slot.transfer = libusb_alloc_transfer(packets);
  if (slot.transfer == nullptr) throw Error(Fault::no_memory, "no memory for USB transfers");
  slot.memory = libusb_dev_mem_alloc(device->handle, bytes());
  slot.kernel_memory = slot.memory != nullptr;
  if (!slot.kernel_memory) slot.memory = new unsigned char[bytes()];
  constexpr unsigned kTimeout = 1000;
  const int length = static_cast<int>(bytes());
  if (settings.isochronous) {
    libusb_fill_iso_transfer(slot.transfer, device->handle, settings.endpoint, slot.memory, length, packets, called_back, &slot, kTimeout);
    libusb_set_iso_packet_lengths(slot.transfer, static_cast<unsigned>(settings.packet_bytes));
  } else {
    libusb_fill_bulk_transfer(slot.transfer, device->handle, settings.endpoint, slot.memory, length, called_back, &slot, kTimeout);
  }
}

int Pool::submit() {
  int code = LIBUSB_SUCCESS;
  const std::lock_guard lock(mutex);
  for (Slot& slot : slots) {
    code = libusb_submit_transfer(slot.transfer);
    if (code != LIBUSB_SUCCESS) break;
    slot.flying = true;
    ++alive;
  }
  return alive > 0 ? LIBUSB_SUCCESS : code;
}

void Pool::deliver(const libusb_transfer& transfer) {
  const auto now = monotonic_now();
  const auto* memory = reinterpret_cast<const std::byte*>(transfer.buffer);
  if (!settings.isochronous) {
    sink->on_packet(status_of(transfer.status), {memory, static_cast<std::size_t>(transfer.actual_length)}, now);
    return;
  }
  for (int i = 0; i < transfer.num_iso_packets; ++i) {
    const auto& packet = transfer.iso_packet_desc[i];
    // The place follows from the index alone: a bad packet takes as much room as a good one.
    const std::size_t length = std::min<std::size_t>(packet.actual_length, settings.packet_bytes);
    sink->on_packet(status_of(packet.status), {memory + static_cast<std::size_t>(i) * settings.packet_bytes, length}, now);
  }
}

void LIBUSB_CALL Pool::called_back(libusb_transfer* transfer) {
  Slot& slot = *static_cast<Slot*>(transfer->user_data);
  Pool& pool = *slot.pool;
  const bool gone = transfer->status == LIBUSB_TRANSFER_NO_DEVICE;
  if (!pool.stopping && transfer->status == LIBUSB_TRANSFER_COMPLETED) pool.deliver(*transfer);
  std::shared_ptr<Pool> last;
  bool end = false;
  {
    const std::lock_guard lock(pool.mutex);
    const bool again = !pool.stopping && !gone && transfer->status != LIBUSB_TRANSFER_CANCELLED;
    if (again && libusb_submit_transfer(transfer) == LIBUSB_SUCCESS) return;
    slot.flying = false;
    --pool.alive;
    // Fewer than half of its transfers cannot carry a stream.
    end = !pool.ended && !pool.stopping && (gone || 2 * pool.alive < static_cast<int>(pool.slots.size()));
    pool.ended = pool.ended || end;
    if (pool.alive == 0) last = std::move(pool.self);
  }
  if (end) pool.sink->on_end(gone ? Status::no_device : Status::error);
  pool.landed.notify_all();
}

class LibusbStream final : public Stream {
 public:
  explicit LibusbStream(std::shared_ptr<Pool> pool) : pool_(std::move(pool)) {}
  ~LibusbStream() override { (void)stop(3s); }

  bool stop(hal::Nanoseconds at_most) noexcept override {
    std::unique_lock lock(pool_->mutex);
    pool_->stopping = true;
    for (auto& slot : pool_->slots)
      if (slot.flying) (void)libusb_cancel_transfer(slot.transfer);
    return pool_->landed.wait_for(lock, at_most, [this] { return pool_->alive == 0; });
  }
  int transfers_alive() const override {
    const std::lock_guard lock(pool_->mutex);
    return pool_->alive;
  }

 private:
  const std::shared_ptr<Pool> pool_;
};

class LibusbDevice final : public Device {
 public:
  LibusbDevice(std::shared_ptr<Handle> handle, DeviceInfo info) : handle_(std::move(handle)), info_(std::move(info)) {}

  const DeviceInfo& info() const override { return info_; }
  int configuration() override {
    int value = 0;
    check(libusb_get_configuration(handle_->handle, &value), "reading the configuration");
    return value;
  }
  void set_configuration(int value) override { check(libusb_set_configuration(handle_->handle, value), "setting the configuration"); }
  void claim(int interface) override { check(libusb_claim_interface(handle_->handle, interface), "claiming interface " + std::to_string(interface)); }
  void release(int interface) noexcept override { (void)libusb_release_interface(handle_->handle, interface); }
  void set_alternate(int interface, int alternate) override {
    const int code = libusb_set_interface_alt_setting(handle_->handle, interface, alternate);
    // The kernel's ENOSPC arrives as "other": a controller that cannot reserve what the stream needs.
    if (code == LIBUSB_ERROR_OTHER && alternate != 0) throw Error(Fault::no_bandwidth, name() + ": opening its stream failed" + remedy(Fault::no_bandwidth));
    check(code, "choosing alternate setting " + std::to_string(alternate));
  }
  std::size_t bytes_per_interval(int interface, int alternate, std::uint8_t endpoint) override;
  void control_out(const ControlRequest& r, std::span<const std::byte> data, hal::Nanoseconds timeout) override {
    std::vector<unsigned char> bytes(data.size());
    std::transform(data.begin(), data.end(), bytes.begin(), [](std::byte b) { return std::to_integer<unsigned char>(b); });
    const int code = libusb_control_transfer(handle_->handle, r.type, r.request, r.value, r.index, bytes.data(), static_cast<std::uint16_t>(bytes.size()),
                                             milliseconds(timeout));
    if (code < 0) fail(code, name() + ": control request " + std::to_string(r.request));
  }
  TransferResult bulk_out(std::uint8_t endpoint, std::span<const std::byte> data, hal::Nanoseconds timeout) override {
    // libusb takes the bytes to send as writable, and leaves them alone.
    return bulk(endpoint, const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(data.data())), data.size(), timeout);
  }
  TransferResult bulk_in(std::uint8_t endpoint, std::span<std::byte> data, hal::Nanoseconds timeout) override {
    return bulk(endpoint, reinterpret_cast<unsigned char*>(data.data()), data.size(), timeout);
  }
  void reset() override { check(libusb_reset_device(handle_->handle), "the bus reset"); }
  std::unique_ptr<Stream> open_stream(const StreamSettings& settings, StreamSink& sink) override;

 private:
  std::string name() const { return "USB device " + info_.serial + " at port " + info_.path; }
  void check(int code, const std::string& what) const {
    if (code != LIBUSB_SUCCESS) fail(code, name() + ": " + what);
  }
  TransferResult bulk(std::uint8_t endpoint, unsigned char* data, std::size_t size, hal::Nanoseconds timeout) {
    int done = 0;
    const int code = libusb_bulk_transfer(handle_->handle, endpoint, data, static_cast<int>(size), &done, milliseconds(timeout));
    const Status status = code == LIBUSB_SUCCESS           ? Status::completed
                          : code == LIBUSB_ERROR_TIMEOUT   ? Status::timed_out
                          : code == LIBUSB_ERROR_PIPE      ? Status::stalled
                          : code == LIBUSB_ERROR_NO_DEVICE ? Status::no_device
                          : code == LIBUSB_ERROR_OVERFLOW  ? Status::overflow
                                                           : Status::error;
    return {status, static_cast<std::size_t>(std::max(done, 0))};
  }

  const std::shared_ptr<Handle> handle_;
  const DeviceInfo info_;
};

std::size_t LibusbDevice::bytes_per_interval(int interface, int alternate, std::uint8_t endpoint) {
  libusb_config_descriptor* config = nullptr;
  check(libusb_get_config_descriptor(libusb_get_device(handle_->handle), 0, &config), "reading its descriptors");
  std::size_t bytes = 0;
  for (int i = 0; i < config->bNumInterfaces; ++i)
    for (int a = 0; a < config->interface[i].num_altsetting; ++a) {
      const auto& setting = config->interface[i].altsetting[a];
      if (setting.bInterfaceNumber != interface || setting.bAlternateSetting != alternate) continue;
      for (int e = 0; e < setting.bNumEndpoints; ++e) {
        const auto& found = setting.endpoint[e];
        if (found.bEndpointAddress != endpoint || (found.bmAttributes & 3) != LIBUSB_TRANSFER_TYPE_ISOCHRONOUS) continue;
        libusb_ss_endpoint_companion_descriptor* companion = nullptr;
        if (libusb_get_ss_endpoint_companion_descriptor(nullptr, &found, &companion) != LIBUSB_SUCCESS) continue;
        bytes = companion->wBytesPerInterval;
        libusb_free_ss_endpoint_companion_descriptor(companion);
      }
    }
  libusb_free_config_descriptor(config);
  return bytes;
}

std::unique_ptr<Stream> LibusbDevice::open_stream(const StreamSettings& settings, StreamSink& sink) {
  const auto pool = std::make_shared<Pool>();
  pool->device = handle_;
  pool->settings = settings;
  pool->sink = &sink;
  pool->slots.resize(static_cast<std::size_t>(settings.transfers));
  for (auto& slot : pool->slots) pool->fill(slot);
  pool->self = pool;
  if (const int code = pool->submit(); code != LIBUSB_SUCCESS) {
    pool->self.reset();
    // usbfs says ENOMEM, which arrives as an I/O error, when all programs together have more in flight than it allows.
    fail(code == LIBUSB_ERROR_IO ? LIBUSB_ERROR_NO_MEM : code, name() + ": submitting its transfers");
  }
  return std::make_unique<LibusbStream>(pool);
}

class LibusbBus final : public Bus {
 public:
  LibusbBus() {
    constexpr int kEvents = LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT;
    if (libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) == 0) return;
    (void)libusb_hotplug_register_callback(context_.get(), kEvents, 0, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, changed,
                                           this, nullptr);
    context_.handle_events();
  }
  std::vector<DeviceInfo> list(std::span<const std::pair<std::uint16_t, std::uint16_t>> ids) override;
  std::unique_ptr<Device> open(const DeviceInfo& info) override;
  std::uint64_t changes() const override { return changes_; }

 private:
  static int LIBUSB_CALL changed(libusb_context*, libusb_device*, libusb_hotplug_event, void* bus) {
    ++static_cast<LibusbBus*>(bus)->changes_;
    return 0;
  }
  std::atomic<std::uint64_t> changes_{0};
  Context context_;
};

/// Devices of a context, with what is known of them unopened. The list is freed with the object.
class DeviceList {
 public:
  explicit DeviceList(libusb_context* context) : count_(libusb_get_device_list(context, &list_)) {}
  ~DeviceList() {
    if (count_ >= 0) libusb_free_device_list(list_, 1);
  }
  DeviceList(const DeviceList&) = delete;
  std::span<libusb_device*> all() const { return {list_, static_cast<std::size_t>(std::max<ssize_t>(0, count_))}; }

 private:
  libusb_device** list_ = nullptr;
  ssize_t count_;
};

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

std::vector<DeviceInfo> LibusbBus::list(std::span<const std::pair<std::uint16_t, std::uint16_t>> ids) {
  std::vector<DeviceInfo> out;
  const DeviceList devices(context_.get());
  for (libusb_device* device : devices.all()) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(device, &descriptor) != LIBUSB_SUCCESS) continue;
    if (std::find(ids.begin(), ids.end(), std::pair(descriptor.idVendor, descriptor.idProduct)) == ids.end()) continue;
    DeviceInfo info = describe(device, descriptor);
    libusb_device_handle* handle = nullptr;
    if (libusb_open(device, &handle) == LIBUSB_SUCCESS) {
      std::array<unsigned char, 128> text{};
      const int n = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(), static_cast<int>(text.size()));
      if (n > 0) info.serial.assign(reinterpret_cast<const char*>(text.data()), static_cast<std::size_t>(n));
      libusb_close(handle);
    }
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
    if (const int code = libusb_open(device, &handle->handle); code != LIBUSB_SUCCESS)
      fail(code, "opening USB device " + info.serial + " at port " + info.path);
    handle->context->handle_events();
    return std::make_unique<LibusbDevice>(std::move(handle), info);
  }
  throw Error(Fault::no_device, "USB device " + info.serial + " at port " + info.path + " is not there any more" + remedy(Fault::no_device));
}

}  // namespace

std::shared_ptr<Bus> make_libusb_bus() { return std::make_shared<LibusbBus>(); }

}  // namespace booth::drivers::usb
