// The sequences, in the order that the hardware is known to accept.
#include "drivers/kinect2/kinect_device.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <thread>

#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {

using namespace std::chrono_literals;

namespace {

constexpr auto kControlTimeout = 1000ms;
constexpr auto kReadyPatience = 5s;
constexpr auto kCancelPatience = 3s;
constexpr int kOpenTries = 10;
constexpr int kColourTransfers = 20;

// Standard control requests (USB 3.1 section 9.4).
constexpr usb::ControlRequest kIsochronousDelay{0x00, 0x31, 40, 0};
constexpr usb::ControlRequest kEnableU1{0x00, 0x03, 48, 0}, kEnableU2{0x00, 0x03, 49, 0};
constexpr usb::ControlRequest kSuspend{0x01, 0x03, 0, 0x0300}, kResume{0x01, 0x03, 0, 0x0000};

}  // namespace

std::string clean_serial(const std::string& serial) {
  const bool good =
      !serial.empty() && serial.size() <= 64 && std::all_of(serial.begin(), serial.end(), [](unsigned char c) { return c < 128 && std::isalnum(c); });
  return good ? serial : std::string();
}

usb::DeviceInfo find_kinect(usb::Bus& bus, const std::string& serial) {
  const auto all = bus.list(kDeviceIds);
  const auto same = [&](const usb::DeviceInfo& d) { return d.serial == serial; };
  const auto found = std::find_if(all.begin(), all.end(), same);
  const std::string name = "Kinect v2 " + serial;
  if (found == all.end())
    throw usb::Error(usb::Fault::no_device,
                     name + " is not on the bus (" + std::to_string(all.size()) + " other sensors are): check its cable and its mains adaptor");
  if (std::count_if(all.begin(), all.end(), same) > 1)
    throw usb::Error(usb::Fault::unsupported, name + " is there twice: two sensors with the same serial cannot be told apart, unplug one of them");
  if (found->speed < usb::Speed::super)
    throw usb::Error(usb::Fault::unsupported, name + " at port " + found->path + " is connected at USB 2 speed: use a USB 3 port and the original cable");
  return *found;
}

KinectDevice::KinectDevice(usb::Bus& bus, const std::string& serial, bool reset, const std::atomic<bool>& cancel) : cancel_(cancel), serial_(serial) {
  for (int attempt = 1; !device_; ++attempt) {
    const auto info = find_kinect(bus, serial);
    try {
      device_ = bus.open(info);
    } catch (const usb::Error& e) {
      if (attempt == kOpenTries || e.fault() == usb::Fault::access) throw;
      nap(100ms);
    }
  }
  if (reset) device_->reset();
  if (device_->configuration() != 1) device_->set_configuration(1);
  device_->claim(kControlInterface);
  device_->claim(kStreamInterface);
  try {
    device_->control_out(kIsochronousDelay, {}, kControlTimeout);
  } catch (const usb::Error& e) {
    if (e.fault() == usb::Fault::no_device) throw;  // anything else: the kernel sends it by itself when it enumerates
  }
  device_->set_alternate(kStreamInterface, 0);
  device_->control_out(kEnableU1, {}, kControlTimeout);
  device_->control_out(kEnableU2, {}, kControlTimeout);
  suspend();
  packet_bytes_ = device_->bytes_per_interval(kStreamInterface, 1, kInfraredIn);
  if (packet_bytes_ < kPacketBytes)
    throw usb::Error(usb::Fault::unsupported, "Kinect v2 " + serial + " offers " + std::to_string(packet_bytes_) +
                                                  " bytes per interval on its infrared stream, " + std::to_string(kPacketBytes) +
                                                  " are needed: it is not a sensor that this driver knows");
  commands_ = std::make_unique<CommandChannel>(*device_);
}

KinectDevice::~KinectDevice() {
  stop();
  infrared_.reset();
  colour_.reset();
  if (!device_) return;
  device_->release(kStreamInterface);
  device_->release(kControlInterface);
}

void KinectDevice::nap(hal::Nanoseconds duration) const {
  const auto end = std::chrono::steady_clock::now() + duration;
  while (std::chrono::steady_clock::now() < end) {
    if (cancel_) throw usb::Error(usb::Fault::other, "Kinect v2 " + serial_ + ": stopped while it was being opened");
    std::this_thread::sleep_for(std::min<hal::Nanoseconds>(duration, 10ms));
  }
}

void KinectDevice::resume() { device_->control_out(kResume, {}, kControlTimeout); }
void KinectDevice::suspend() { device_->control_out(kSuspend, {}, kControlTimeout); }

Calibration KinectDevice::calibration(CalibrationCache* cache) {
  resume();
  const std::string firmware = commands_->firmware();
  if (cache != nullptr)
    if (auto known = cache->load(serial_, firmware)) return std::move(*known);
  Calibration out;
  out.serial = serial_;
  out.firmware = firmware;
  out.depth = commands_->depth_camera();
  out.phase = commands_->phase_offsets();
  out.colour = commands_->colour_camera();
  if (cache != nullptr) cache->store(out);
  return out;
}

void KinectDevice::wait_until_ready() {
  const auto end = std::chrono::steady_clock::now() + kReadyPatience;
  while ((commands_->status() & 1u) == 0) {
    if (std::chrono::steady_clock::now() >= end)
      throw NotReady("Kinect v2 " + serial_ +
                     " did not become ready within five seconds: if rebooting it does not help, unplug its mains adaptor for ten seconds");
    nap(100ms);
  }
}

void KinectDevice::streaming(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour) {
  resume();
  wait_until_ready();
  commands_->start_infrared();
  device_->set_alternate(kStreamInterface, 1);  // the place where a controller without bandwidth refuses
  (void)commands_->status();
  if (colour != nullptr) {
    commands_->colour(true);
    colour_ = device_->open_stream({.endpoint = kColourIn, .packet_bytes = kColourTransferBytes, .transfers = kColourTransfers}, *colour);
  }
  infrared_ = device_->open_stream(
      {.endpoint = kInfraredIn, .isochronous = true, .packet_bytes = packet_bytes_, .packets_per_transfer = kPacketsPerTransfer, .transfers = transfers},
      infrared);
}

void KinectDevice::start(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour) {
  started_ = true;
  try {
    streaming(transfers, infrared, colour);
  } catch (...) {
    stop();
    throw;
  }
}

bool KinectDevice::stop() noexcept {
  if (!started_) return true;
  started_ = false;
  bool all_back = true;
  if (colour_) all_back = colour_->stop(kCancelPatience) && all_back;
  if (infrared_) all_back = infrared_->stop(kCancelPatience) && all_back;
  const bool with_colour = colour_ != nullptr;
  colour_.reset();
  infrared_.reset();
  try {
    device_->set_alternate(kStreamInterface, 0);
    commands_->stop_infrared();
    if (with_colour) commands_->colour(false);
    suspend();
  } catch (const std::exception&) {
    // A device that is gone or hangs cannot be stopped more politely; closing it is what is left, and the next open begins with a reset.
    return false;
  }
  return all_back;
}

void KinectDevice::reboot() { commands_->reboot(); }

}  // namespace booth::drivers::kinect2
