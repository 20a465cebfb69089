// What a real kernel and a real libusb make of the emulated sensor's descriptors: strings, SuperSpeed companion, device capabilities.
#include <libusb-1.0/libusb.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/emulator/forward_model.hpp"
#include "drivers/kinect2/emulator/vhci_box.hpp"
#include "drivers/kinect2/layout.hpp"

namespace {

using namespace std::chrono_literals;
using namespace booth::drivers;
using namespace booth::drivers::kinect2;

int failures = 0;

void expect(bool ok, const std::string& what) {
  if (ok) return;
  std::printf("why: %s\n", what.c_str());
  ++failures;
}

libusb_device_handle* find(libusb_context* context) {
  // Without a daemon that tells of arrivals, a new list is what sees them; the kernel takes a moment to enumerate.
  return libusb_open_device_with_vid_pid(context, kDeviceIds[0].first, kDeviceIds[0].second);
}

std::string text(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 128> bytes{};
  const int n = libusb_get_string_descriptor_ascii(handle, index, bytes.data(), static_cast<int>(bytes.size()));
  return n < 0 ? std::string(libusb_error_name(n)) : std::string(bytes.begin(), bytes.begin() + n);
}

void check_companion(libusb_context* context, libusb_device* device) {
  libusb_config_descriptor* config = nullptr;
  if (libusb_get_active_config_descriptor(device, &config) != 0) return expect(false, "the kernel did not configure the device");
  expect(config->bNumInterfaces == 2, "there are " + std::to_string(config->bNumInterfaces) + " interfaces, 2 are expected");
  const auto& interface = config->interface[kStreamInterface];
  expect(interface.num_altsetting == 2, "interface 1 has " + std::to_string(interface.num_altsetting) + " alternate settings, 2 are expected");
  if (interface.num_altsetting == 2 && interface.altsetting[1].bNumEndpoints == 1) {
    const auto& endpoint = interface.altsetting[1].endpoint[0];
    libusb_ss_endpoint_companion_descriptor* companion = nullptr;
    expect(endpoint.bEndpointAddress == kInfraredIn, "the stream's endpoint is not 0x84");
    if (libusb_get_ss_endpoint_companion_descriptor(context, &endpoint, &companion) == 0) {
      expect(companion->wBytesPerInterval == kPacketBytes, "wBytesPerInterval is " + std::to_string(companion->wBytesPerInterval) + ", 33792 are expected");
      std::printf("figure: wBytesPerInterval %u, bMaxBurst %u, bmAttributes %u\n", companion->wBytesPerInterval, companion->bMaxBurst, companion->bmAttributes);
      libusb_free_ss_endpoint_companion_descriptor(companion);
    } else {
      expect(false, "endpoint 0x84 has no SuperSpeed companion");
    }
  } else {
    expect(false, "interface 1 has no endpoint at alternate setting 1");
  }
  libusb_free_config_descriptor(config);
}

void check_capabilities(libusb_context* context, libusb_device_handle* handle) {
  libusb_bos_descriptor* bos = nullptr;
  if (libusb_get_bos_descriptor(handle, &bos) != 0) return expect(false, "there is no BOS descriptor");
  expect(bos->bNumDeviceCaps == 2, "the BOS descriptor has " + std::to_string(bos->bNumDeviceCaps) + " capabilities, 2 are expected");
  bool super = false;
  for (int i = 0; i < bos->bNumDeviceCaps; ++i) {
    libusb_ss_usb_device_capability_descriptor* capability = nullptr;
    if (bos->dev_capability[i]->bDevCapabilityType != LIBUSB_BT_SS_USB_DEVICE_CAPABILITY) continue;
    if (libusb_get_ss_usb_device_capability_descriptor(context, bos->dev_capability[i], &capability) != 0) continue;
    super = capability->wSpeedSupported == LIBUSB_SUPER_SPEED_OPERATION;
    libusb_free_ss_usb_device_capability_descriptor(capability);
  }
  expect(super, "the BOS descriptor does not say SuperSpeed");
  libusb_free_bos_descriptor(bos);
}

}  // namespace

int main() {
  const auto box = emulator::make_vhci_box(std::make_shared<SystemClock>());
  box->plug(box->add({.device = {.serial = "501000000001", .camera = emulator::typical_camera(), .view = {}}}));
  libusb_device_handle* handle = nullptr;
  libusb_context* context = nullptr;
  for (int i = 0; i < 100 && handle == nullptr; ++i) {
    if (context != nullptr) libusb_exit(context);
    context = nullptr;
    if (libusb_init(&context) != 0) return 1;
    handle = find(context);
    if (handle == nullptr) std::this_thread::sleep_for(50ms);
  }
  if (handle == nullptr) {
    std::printf("why: the kernel did not enumerate the emulated sensor; %s\n", box->error(0).c_str());
    return 1;
  }
  libusb_device* device = libusb_get_device(handle);
  libusb_device_descriptor descriptor{};
  (void)libusb_get_device_descriptor(device, &descriptor);
  expect(libusb_get_device_speed(device) == LIBUSB_SPEED_SUPER, "it is not connected at SuperSpeed");
  expect(descriptor.bcdUSB == 0x0300 && descriptor.bcdDevice == 0x0100, "bcdUSB or bcdDevice is wrong");
  expect(text(handle, descriptor.iManufacturer) == "Microsoft", "the maker is \"" + text(handle, descriptor.iManufacturer) + "\"");
  expect(text(handle, descriptor.iProduct) == "Xbox NUI Sensor", "the product is \"" + text(handle, descriptor.iProduct) + "\"");
  expect(text(handle, descriptor.iSerialNumber) == "501000000001", "the serial is \"" + text(handle, descriptor.iSerialNumber) + "\"");
  check_companion(context, device);
  check_capabilities(context, handle);
  libusb_close(handle);
  libusb_exit(context);
  return failures == 0 ? 0 : 1;
}
