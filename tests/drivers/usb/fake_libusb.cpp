// The functions themselves, small enough to be believed.
#include "tests/drivers/usb/fake_libusb.hpp"

#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdarg>
#include <cstring>
#include <memory>
#include <new>

struct libusb_context {
  int unused;
};
struct libusb_device {
  int unused;
};
struct libusb_device_handle {
  libusb_context* context;
};

static constexpr int kEventsFile = 1'000'000, kDeviceFile = 1'000'001;  // no such files

namespace booth::tests {
namespace {
std::unique_ptr<FakeLibusb>& holder() {
  static auto fake = std::make_unique<FakeLibusb>();
  return fake;
}
libusb_device the_device;

libusb_endpoint_descriptor stream_endpoint = [] {
  libusb_endpoint_descriptor e{};
  e.bEndpointAddress = 0x84;
  e.bmAttributes = LIBUSB_TRANSFER_TYPE_ISOCHRONOUS;
  return e;
}();
}  // namespace

FakeLibusb& fake_libusb() { return *holder(); }
void reset_fake_libusb() {
  const auto log = holder()->log;  // set once for the process
  holder() = std::make_unique<FakeLibusb>();
  holder()->log = log;
}

void FakeLibusb::land(libusb_transfer* transfer, libusb_transfer_status status, int bytes) {
  const std::lock_guard lock(mutex);
  landings.push_back({transfer, status, bytes});
  changed.notify_all();
}
void FakeLibusb::land_all(libusb_transfer_status status) {
  const std::lock_guard lock(mutex);
  for (auto* t : flying) landings.push_back({t, status, 0});
  changed.notify_all();
}
void FakeLibusb::fire_hotplug() { hotplug_callback(nullptr, &the_device, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, hotplug_data); }
int FakeLibusb::in_flight() {
  const std::lock_guard lock(mutex);
  return static_cast<int>(flying.size());
}

}  // namespace booth::tests

using booth::tests::fake_libusb;

extern "C" {

int LIBUSB_CALL libusb_init(libusb_context** out) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  ++f.contexts;
  *out = new libusb_context{};
  return LIBUSB_SUCCESS;
}
void LIBUSB_CALL libusb_exit(libusb_context* context) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  --f.contexts;
  if (f.contexts == 0 && f.handles > 0) f.offences.push_back("exit with open handles");
  delete context;
  f.changed.notify_all();
}
int LIBUSB_CALL libusb_set_option(libusb_context*, libusb_option, ...) { return LIBUSB_SUCCESS; }
void LIBUSB_CALL libusb_set_log_cb(libusb_context*, libusb_log_cb callback, int) { fake_libusb().log = callback; }
int LIBUSB_CALL libusb_has_capability(std::uint32_t) { return fake_libusb().hotplug; }
int LIBUSB_CALL libusb_hotplug_register_callback(libusb_context*, int, int, int, int, int, libusb_hotplug_callback_fn callback, void* data,
                                                 libusb_hotplug_callback_handle*) {
  fake_libusb().hotplug_callback = callback;
  fake_libusb().hotplug_data = data;
  return LIBUSB_SUCCESS;
}
ssize_t LIBUSB_CALL libusb_get_device_list(libusb_context*, libusb_device*** list) {
  *list = new libusb_device* [] { &booth::tests::the_device, nullptr };
  return 1;
}
void LIBUSB_CALL libusb_free_device_list(libusb_device** list, int) { delete[] list; }
int LIBUSB_CALL libusb_get_device_descriptor(libusb_device*, libusb_device_descriptor* out) {
  *out = {};
  out->idVendor = 0x045E;
  out->idProduct = 0x02C4;
  out->iSerialNumber = 3;
  return LIBUSB_SUCCESS;
}
std::uint8_t LIBUSB_CALL libusb_get_bus_number(libusb_device*) { return 2; }
std::uint8_t LIBUSB_CALL libusb_get_device_address(libusb_device*) { return 5; }
int LIBUSB_CALL libusb_get_port_numbers(libusb_device*, std::uint8_t* ports, int) {
  ports[0] = 1;
  return 1;
}
int LIBUSB_CALL libusb_get_device_speed(libusb_device*) { return LIBUSB_SPEED_SUPER; }
int LIBUSB_CALL libusb_open(libusb_device*, libusb_device_handle** out) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  ++f.handles;
  ++f.opens;
  *out = new libusb_device_handle{nullptr};
  return LIBUSB_SUCCESS;
}
void LIBUSB_CALL libusb_close(libusb_device_handle* handle) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  --f.handles;
  if (std::any_of(f.flying.begin(), f.flying.end(), [&](const auto* t) { return t->dev_handle == handle; }))
    f.offences.push_back("close with transfers in flight");
  delete handle;
}
libusb_device* LIBUSB_CALL libusb_get_device(libusb_device_handle*) { return &booth::tests::the_device; }
int LIBUSB_CALL libusb_get_string_descriptor_ascii(libusb_device_handle*, std::uint8_t, unsigned char* out, int) {
  std::memcpy(out, "asked", 5);
  return 5;
}
int LIBUSB_CALL libusb_get_configuration(libusb_device_handle*, int* out) {
  *out = fake_libusb().active_configuration;
  return LIBUSB_SUCCESS;
}
int LIBUSB_CALL libusb_set_configuration(libusb_device_handle*, int) { return LIBUSB_SUCCESS; }
int LIBUSB_CALL libusb_claim_interface(libusb_device_handle*, int) { return LIBUSB_SUCCESS; }
int LIBUSB_CALL libusb_release_interface(libusb_device_handle*, int) { return LIBUSB_SUCCESS; }
/// The device's file, as libusb polls it: the only one that is polled for writing.
const libusb_pollfd** libusb_get_pollfds(libusb_context*) {
  static const libusb_pollfd events{kEventsFile, POLLIN}, device{kDeviceFile, POLLOUT};
  static const libusb_pollfd* both[]{&events, &device, nullptr};
  return both;
}
void libusb_free_pollfds(const libusb_pollfd**) {}

/// The kernel's answer on that file; every other file is the kernel's own affair.
int ioctl(int file, unsigned long request, ...) noexcept {
  va_list rest;
  va_start(rest, request);
  void* argument = va_arg(rest, void*);
  va_end(rest);
  if (file != kDeviceFile) return static_cast<int>(::syscall(SYS_ioctl, file, request, argument));
  ++fake_libusb().alternates_chosen;
  errno = fake_libusb().alternate_errno;
  return errno == 0 ? 0 : -1;
}
int LIBUSB_CALL libusb_reset_device(libusb_device_handle*) { return LIBUSB_ERROR_NOT_FOUND; }

int LIBUSB_CALL libusb_get_active_config_descriptor(libusb_device*, libusb_config_descriptor** out) {
  auto* setting = new libusb_interface_descriptor{};
  setting->bInterfaceNumber = 1;
  setting->bAlternateSetting = 1;
  setting->bNumEndpoints = 1;
  setting->endpoint = &booth::tests::stream_endpoint;
  auto* interface = new libusb_interface{setting, 1};
  *out = new libusb_config_descriptor{};
  (*out)->bNumInterfaces = 1;
  (*out)->interface = interface;
  return LIBUSB_SUCCESS;
}
void LIBUSB_CALL libusb_free_config_descriptor(libusb_config_descriptor* config) {
  delete config->interface->altsetting;
  delete config->interface;
  delete config;
}
int LIBUSB_CALL libusb_get_ss_endpoint_companion_descriptor(libusb_context* context, const libusb_endpoint_descriptor*,
                                                            libusb_ss_endpoint_companion_descriptor** out) {
  if (context == nullptr) fake_libusb().offences.push_back("the default context was used");
  *out = new libusb_ss_endpoint_companion_descriptor{};
  (*out)->wBytesPerInterval = 33'792;
  return LIBUSB_SUCCESS;
}
void LIBUSB_CALL libusb_free_ss_endpoint_companion_descriptor(libusb_ss_endpoint_companion_descriptor* d) { delete d; }

libusb_transfer* LIBUSB_CALL libusb_alloc_transfer(int packets) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  ++f.transfers;
  const std::size_t bytes = sizeof(libusb_transfer) + static_cast<std::size_t>(packets) * sizeof(libusb_iso_packet_descriptor);
  auto* memory = ::operator new(bytes);
  std::memset(memory, 0, bytes);
  auto* transfer = static_cast<libusb_transfer*>(memory);
  transfer->num_iso_packets = packets;
  return transfer;
}
void LIBUSB_CALL libusb_free_transfer(libusb_transfer* transfer) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  if (transfer == nullptr) return;
  --f.transfers;
  if (std::find(f.flying.begin(), f.flying.end(), transfer) != f.flying.end()) f.offences.push_back("a transfer in flight was freed");
  ::operator delete(transfer);
}
int LIBUSB_CALL libusb_submit_transfer(libusb_transfer* transfer) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  if (f.submissions_left == 0) {
    errno = f.submit_errno;
    return f.submit_code;
  }
  if (f.submissions_left > 0) --f.submissions_left;
  f.flying.push_back(transfer);
  f.changed.notify_all();
  return LIBUSB_SUCCESS;
}
int LIBUSB_CALL libusb_cancel_transfer(libusb_transfer* transfer) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  if (std::find(f.flying.begin(), f.flying.end(), transfer) == f.flying.end()) return LIBUSB_ERROR_NOT_FOUND;
  if (f.cancel_answers) f.landings.push_back({transfer, LIBUSB_TRANSFER_CANCELLED, 0});
  f.changed.notify_all();
  return LIBUSB_SUCCESS;
}
int LIBUSB_CALL libusb_handle_events_timeout_completed(libusb_context*, timeval* tv, int*) {
  auto& f = fake_libusb();
  std::unique_lock lock(f.mutex);
  ++f.event_rounds;
  if (f.events_code != 0) return f.events_code;
  f.changed.wait_for(lock, std::chrono::microseconds(tv->tv_usec), [&] { return f.interrupted || !f.landings.empty(); });
  f.interrupted = false;
  if (f.landings.empty()) return LIBUSB_SUCCESS;
  const auto landing = f.landings.front();
  f.landings.pop_front();
  const auto it = std::find(f.flying.begin(), f.flying.end(), landing.transfer);
  if (it == f.flying.end()) return LIBUSB_SUCCESS;  // cancelled and landed at once
  f.flying.erase(it);
  landing.transfer->status = landing.status;
  landing.transfer->actual_length = landing.bytes;
  lock.unlock();
  landing.transfer->callback(landing.transfer);
  return LIBUSB_SUCCESS;
}
void LIBUSB_CALL libusb_interrupt_event_handler(libusb_context*) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  f.interrupted = true;
  f.changed.notify_all();
}
unsigned char* LIBUSB_CALL libusb_dev_mem_alloc(libusb_device_handle*, size_t bytes) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  if (!f.kernel_memory) return nullptr;
  ++f.kernel_buffers;
  return new unsigned char[bytes];
}
int LIBUSB_CALL libusb_dev_mem_free(libusb_device_handle*, unsigned char* memory, size_t) {
  auto& f = fake_libusb();
  const std::lock_guard lock(f.mutex);
  --f.kernel_buffers;
  delete[] memory;
  return LIBUSB_SUCCESS;
}
const char* LIBUSB_CALL libusb_strerror(int) { return "as libusb says it"; }

}  // extern "C"
