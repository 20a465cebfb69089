// The sequences, in the order that the hardware is known to accept.
#include "drivers/kinect2/kinect_device.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <thread>
#include <utility>

#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {

using namespace std::chrono_literals;

namespace {

constexpr int kOpenTries = 10;
constexpr int kColourTransfers = 20;
constexpr int kBright = 100;  ///< of 1000, the level of the light that known drivers choose

// Standard control requests (USB 3.1 section 9.4).
constexpr usb::ControlRequest kIsochronousDelay{0x00, 0x31, 40, 0};
constexpr usb::ControlRequest kEnableU1{0x00, 0x03, 48, 0}, kEnableU2{0x00, 0x03, 49, 0};
constexpr usb::ControlRequest kSuspend{0x01, 0x03, 0, 0x0300}, kResume{0x01, 0x03, 0, 0x0000};

std::string hexadecimal(std::uint32_t value) {
  char text[16];
  std::snprintf(text, sizeof text, "0x%04x", static_cast<unsigned>(value));
  return text;
}

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
  if (found->speed == usb::Speed::unknown)
    throw usb::Error(usb::Fault::unsupported, name + " at port " + found->path + ": the kernel does not say at which speed it is connected");
  if (found->speed < usb::Speed::super)
    throw usb::Error(usb::Fault::unsupported, name + " at port " + found->path + " is connected at USB 2 speed: use a USB 3 port and the original cable");
  return *found;
}

KinectDevice::KinectDevice(usb::Bus& bus, const std::string& serial, DeviceOptions options, const std::atomic<bool>& cancel)
    : cancel_(cancel), serial_(serial), options_(std::move(options)) {
  open(bus);
  if (options_.reset) reset(bus);
  prepare();
  commands_ = std::make_unique<CommandChannel>(*device_, options_.notes);
  commands_->drain();
}

std::string KinectDevice::name() const { return "Kinect v2 " + serial_ + (device_ ? " at port " + device_->info().path : ""); }

void KinectDevice::open(usb::Bus& bus) {
  for (int attempt = 1; !device_; ++attempt) {
    const auto info = find_kinect(bus, serial_);
    try {
      device_ = bus.open(info);
    } catch (const usb::Error& e) {
      if (attempt == kOpenTries || e.fault() == usb::Fault::access) throw;
      nap(options_.patience.open_again);
    }
  }
}

void KinectDevice::reset(usb::Bus& bus) {
  try {
    device_->reset();
  } catch (const usb::Error& e) {
    if (e.fault() != usb::Fault::not_found) throw;
    // It came back as another device, which has been reset by that.
    device_.reset();
    nap(options_.patience.renumbered);
    open(bus);
  }
}

void KinectDevice::prepare() {
  const auto timeout = options_.patience.control;
  if (device_->configuration() != 1) device_->set_configuration(1);
  device_->claim(kControlInterface);
  device_->claim(kStreamInterface);
  try {
    device_->control_out(kIsochronousDelay, {}, timeout);
  } catch (const usb::Error& e) {
    if (e.fault() == usb::Fault::no_device) throw;  // anything else: the kernel sends it by itself when it enumerates
  }
  device_->set_alternate(kStreamInterface, 0);
  device_->control_out(kEnableU1, {}, timeout);
  device_->control_out(kEnableU2, {}, timeout);
  suspend();
  packet_bytes_ = device_->bytes_per_interval(kStreamInterface, 1, kInfraredIn);
  if (packet_bytes_ < kPacketBytes)
    throw usb::Error(usb::Fault::unsupported, name() + " offers " + std::to_string(packet_bytes_) + " bytes per interval on its infrared stream, " +
                                                  std::to_string(kPacketBytes) + " are needed: it is not a sensor that this driver knows");
}

KinectDevice::~KinectDevice() {
  (void)stop();
  infrared_.reset();
  colour_.reset();
  if (!device_) return;
  device_->release(kStreamInterface);
  device_->release(kControlInterface);
}

void KinectDevice::nap(hal::Nanoseconds duration) const {
  const auto end = std::chrono::steady_clock::now() + duration;
  while (std::chrono::steady_clock::now() < end) {
    if (cancel_) throw Cancelled("Kinect v2 " + serial_ + ": stopped while it was being started");
    std::this_thread::sleep_for(std::min<hal::Nanoseconds>(duration, 10ms));
  }
}

void KinectDevice::resume() { device_->control_out(kResume, {}, options_.patience.control); }
void KinectDevice::suspend() { device_->control_out(kSuspend, {}, options_.patience.control); }

void KinectDevice::identify() {
  if (!firmware_.empty()) return;
  const std::string firmware = commands_->firmware();
  const std::string board = commands_->board();
  note(options_.notes, Gravity::info, name() + ": firmware " + firmware + (board.empty() ? "" : ", board " + board));
  try {
    if (const std::string serial = commands_->serial(); serial != serial_)
      note(options_.notes, Gravity::warning, name() + " calls itself " + serial + " when asked by command; the serial of its plug is used");
  } catch (const CommandError& e) {
    if (e.kind() != CommandError::Kind::short_data && e.kind() != CommandError::Kind::refused && e.kind() != CommandError::Kind::premature) throw;
    note(options_.notes, Gravity::warning, std::string(e.what()) + "; the serial of its plug is used");
  }
  firmware_ = firmware;
}

Calibration KinectDevice::calibration(CalibrationCache* cache) {
  resume();
  identify();
  if (cache != nullptr)
    if (auto known = cache->load(serial_, firmware_)) return std::move(*known);
  Calibration out;
  out.serial = serial_;
  out.firmware = firmware_;
  out.depth = commands_->depth_camera();
  out.phase = commands_->phase_offsets();
  out.colour = commands_->colour_camera();
  if (cache != nullptr && !cache->store(out))
    note(options_.notes, Gravity::warning,
         name() + ": its calibration could not be written to cameras.kinect2.cache; it is read from the device at each start");
  return out;
}

void KinectDevice::lights(int level) noexcept {
  try {
    commands_->light(1, level);
    commands_->light(0, 0);
  } catch (const std::exception&) {
    // They tell a person that it is on. A device that is in trouble will say so at the next command.
  }
}

std::uint32_t KinectDevice::wait_until_ready() {
  const auto end = std::chrono::steady_clock::now() + options_.patience.ready;
  while (true) {
    const std::uint32_t status = commands_->status();
    if ((status & 1u) != 0) return status;
    if (std::chrono::steady_clock::now() >= end)
      throw NotReady(name() + " did not become ready within " +
                     std::to_string(std::chrono::duration_cast<std::chrono::seconds>(options_.patience.ready).count()) + " seconds (status " +
                     hexadecimal(status) + "): if rebooting it does not help, unplug its mains adaptor for ten seconds");
    nap(options_.patience.ready_poll);
  }
}

void KinectDevice::streaming(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour) {
  resume();
  identify();
  lights(kBright);
  const std::uint32_t before = wait_until_ready();
  commands_->start_infrared();
  device_->set_alternate(kStreamInterface, 1);  // the place where a controller without bandwidth refuses
  const std::uint32_t after = commands_->status();
  note(options_.notes, Gravity::info, name() + ": status " + hexadecimal(before) + ", " + hexadecimal(after) + " after the start of infrared");
  if (colour != nullptr) {
    colour_on_ = true;
    commands_->colour(true);
    colour_ = device_->open_stream({.endpoint = kColourIn, .packet_bytes = kColourTransferBytes, .transfers = kColourTransfers}, *colour);
  }
  infrared_ = device_->open_stream(
      {.endpoint = kInfraredIn, .isochronous = true, .packet_bytes = packet_bytes_, .packets_per_transfer = kPacketsPerTransfer, .transfers = transfers},
      infrared);
}

void KinectDevice::start(int transfers, usb::StreamSink& infrared, usb::StreamSink* colour) {
  (void)stop();
  started_ = true;
  try {
    streaming(transfers, infrared, colour);
  } catch (...) {
    (void)stop();
    throw;
  }
}

bool KinectDevice::stop() noexcept {
  if (!started_) return true;
  started_ = false;
  bool all_back = true;
  if (colour_) all_back = colour_->stop(options_.patience.cancel) && all_back;
  if (infrared_) all_back = infrared_->stop(options_.patience.cancel) && all_back;
  const bool with_colour = std::exchange(colour_on_, false);
  colour_.reset();
  infrared_.reset();
  try {
    device_->set_alternate(kStreamInterface, 0);
    commands_->stop_infrared();
    if (with_colour) commands_->colour(false);
    lights(0);
    suspend();
  } catch (const std::exception&) {
    // A device that is gone or hangs cannot be stopped more politely; closing it is what is left, and the next open begins with a reset.
    return false;
  }
  return all_back;
}

void KinectDevice::reboot() { commands_->reboot(); }

}  // namespace booth::drivers::kinect2
