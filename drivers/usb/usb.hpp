// The narrow view of USB that camera drivers need, so that libusb and an in-process fake can stand behind it alike.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/time.hpp"

namespace booth::drivers::usb {

enum class Speed : std::uint8_t { unknown, low, full, high, super, super_plus };

/// How a transfer, or one packet of it, ended.
enum class Status : std::uint8_t { completed, timed_out, stalled, no_device, overflow, cancelled, error };

/// Why a request was refused.
enum class Fault : std::uint8_t { io, access, no_device, not_found, busy, timeout, stall, no_bandwidth, no_memory, unsupported, other };

/// Names the device, the request and the remedy.
class Error : public std::runtime_error {
 public:
  Error(Fault fault, const std::string& sentence) : std::runtime_error(sentence), fault_(fault) {}
  Fault fault() const { return fault_; }

 private:
  Fault fault_;
};

/// One device on the bus, as seen without opening it. `path` is the kernel's name of the port ("2-1.3"), stable while the cable stays where it is.
struct DeviceInfo {
  std::uint16_t vendor = 0, product = 0;
  Speed speed = Speed::unknown;
  int bus = 0, address = 0;
  std::string path;
  std::string serial;  ///< as the device says, unchecked; empty where it could not be read
};

struct TransferResult {
  Status status = Status::error;
  std::size_t bytes = 0;
};

/// The eight bytes of a control request without data in.
struct ControlRequest {
  std::uint8_t type = 0, request = 0;
  std::uint16_t value = 0, index = 0;
};

/// What a stream hands on, on the stream's event thread: it must copy what it keeps and return soon.
class StreamSink {
 public:
  virtual ~StreamSink() = default;
  /// One isochronous packet, or one bulk transfer, in the order of the bus. `data` is valid during the call; empty packets come too. `arrived` is when the
  /// host was told of the transfer.
  virtual void on_packet(Status status, std::span<const std::byte> data, hal::MonotonicTime arrived) = 0;
  /// No more packets: stopped (cancelled; on the thread that stopped), or the device is gone (no_device), or too few transfers could be submitted again
  /// (error). Called once for each stream that open_stream() returned, before its stop() returns.
  virtual void on_end(Status reason) = 0;
};

struct StreamSettings {
  std::uint8_t endpoint = 0;
  bool isochronous = false;
  std::size_t packet_bytes = 0;  ///< isochronous: of one packet; bulk: of one transfer
  int packets_per_transfer = 1;  ///< isochronous only
  int transfers = 1;             ///< all allocated when the stream is opened
};

/// Transfers in flight. Its memory is taken when it is opened; nothing is allocated per packet.
class Stream {
 public:
  virtual ~Stream() = default;  ///< stops; what cannot be cancelled in time is kept alive until it has called back, never freed early
  /// Cancels and waits until every transfer has called back, at most so long. False when some have not; the sink hears nothing more either way. Harmless
  /// when stopped. Not from a sink's call.
  virtual bool stop(hal::Nanoseconds at_most) noexcept = 0;
  virtual int transfers_alive() const = 0;
};

/// An opened device. Not thread-safe, except that streams deliver on their own thread and bulk and control calls may be made meanwhile. Requests throw Error;
/// bulk transfers return how they ended, because a time-out there is news and not a fault.
class Device {
 public:
  virtual ~Device() = default;  ///< closes; streams must be gone
  virtual const DeviceInfo& info() const = 0;
  virtual int configuration() = 0;
  virtual void set_configuration(int value) = 0;
  virtual void claim(int interface) = 0;
  virtual void release(int interface) noexcept = 0;
  virtual void set_alternate(int interface, int alternate) = 0;
  /// wBytesPerInterval of the SuperSpeed companion of an endpoint in the active configuration; 0 where there is no such isochronous endpoint.
  virtual std::size_t bytes_per_interval(int interface, int alternate, std::uint8_t endpoint) = 0;
  /// Host to device, `data` may be empty.
  virtual void control_out(const ControlRequest& request, std::span<const std::byte> data, hal::Nanoseconds timeout) = 0;
  virtual TransferResult bulk_out(std::uint8_t endpoint, std::span<const std::byte> data, hal::Nanoseconds timeout) = 0;
  virtual TransferResult bulk_in(std::uint8_t endpoint, std::span<std::byte> data, hal::Nanoseconds timeout) = 0;
  /// Bus reset. Throws Error(not_found) when the device came back as another one and must be opened anew.
  virtual void reset() = 0;
  /// `sink` outlives the stream. Throws Error when fewer than half of the transfers could be submitted.
  virtual std::unique_ptr<Stream> open_stream(const StreamSettings& settings, StreamSink& sink) = 0;
};

/// Everything plugged in. Thread-safe; outlives its devices.
class Bus {
 public:
  virtual ~Bus() = default;
  /// Devices of one of these (vendor, product) pairs, in the order of their paths. Serials are read where permitted.
  virtual std::vector<DeviceInfo> list(std::span<const std::pair<std::uint16_t, std::uint16_t>> ids) = 0;
  /// Throws Error(no_device) when it is gone meanwhile, Error(access) with the udev rule to install.
  virtual std::unique_ptr<Device> open(const DeviceInfo& info) = 0;
  /// Grows with each arrival or removal, so that who waits for a device need not list the bus over and over.
  virtual std::uint64_t changes() const = 0;
};

}  // namespace booth::drivers::usb
