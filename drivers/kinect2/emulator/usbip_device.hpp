// One emulated sensor at the far end of a USB/IP connection: it answers and streams what its model says, and whoever holds the near end (a kernel's
// vhci_hcd, or a test) sees a device.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "drivers/kinect2/emulator/control_endpoint.hpp"
#include "drivers/kinect2/emulator/device_model.hpp"
#include "drivers/kinect2/emulator/usbip_protocol.hpp"
#include "hal/clock.hpp"

namespace booth::drivers::kinect2::emulator {

/// Two threads: one answers requests, one streams. The stream loses nothing by itself: a host that is late with its transfers makes the device slower,
/// where a sensor would lose packets. Public calls from any thread.
class UsbipDevice {
 public:
  /// Takes the socket. `device_id` is the one that was told to the other side.
  UsbipDevice(std::shared_ptr<DeviceModel> model, Identity identity, std::uint32_t device_id, int socket, std::shared_ptr<hal::Clock> clock,
              hal::Nanoseconds packet_time);
  ~UsbipDevice();
  UsbipDevice(const UsbipDevice&) = delete;

  /// Pulls the plug; returns at once.
  void leave();
  /// The connection is over, by either side's will.
  bool ended() const { return ended_; }
  /// Why it ended, where that was nobody's will; else empty.
  std::string error() const;
  /// The device left by itself, because it was told to reboot.
  bool rebooting() const { return rebooting_; }
  std::uint64_t packets_sent() const { return packets_sent_; }

 private:
  struct Waiting {
    usbip::Submit request;
    std::vector<usbip::Packet> packets;
  };

  void answer_requests();
  void handle(const usbip::Submit& request);
  void handle(const usbip::Unlink& request);
  void control(const usbip::Submit& request, std::span<const std::byte> data);
  void command(const usbip::Submit& request, std::span<const std::byte> data);
  void pump_replies();
  bool leaves_now();

  void stream();
  bool wait_for_transfer();
  bool put(usb::Status status, std::span<const std::byte> data);
  void begin_transfer();
  void end_transfer();

  bool receive(std::span<std::byte> bytes);
  void send(std::span<const std::byte> header, std::span<const std::byte> payload = {}, std::span<const std::byte> tail = {});

  const std::shared_ptr<DeviceModel> model_;
  const std::shared_ptr<hal::Clock> clock_;
  const hal::Nanoseconds packet_time_;
  const std::uint32_t id_;
  const int socket_;
  ControlEndpoint control_;

  // Who takes a transfer answers it before anybody else may speak: an answer to its cancellation must not overtake its own.
  mutable std::mutex mutex_;
  std::condition_variable transfers_;
  std::deque<Waiting> infrared_, colour_, replies_, other_;
  std::vector<std::byte> reply_;  ///< what is left of the reply that is being read
  std::size_t reply_at_ = 0;
  std::string error_;
  std::atomic<bool> ended_{false}, rebooting_{false};
  std::atomic<std::uint64_t> packets_sent_{0};

  // The stream's thread only.
  std::vector<usbip::Packet> packets_;  ///< of the transfer that is being filled
  std::size_t filled_ = 0;
  std::vector<std::byte> payload_, tail_;
  hal::MonotonicTime slot_{};  ///< when the next packet is due

  std::thread requests_thread_, stream_thread_;
};

}  // namespace booth::drivers::kinect2::emulator
