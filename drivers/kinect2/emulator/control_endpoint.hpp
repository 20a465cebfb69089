// Endpoint 0 of an emulated sensor, for transports on which a real kernel talks to it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/kinect2/emulator/descriptors.hpp"

namespace booth::drivers::kinect2::emulator {

class DeviceModel;

/// The eight bytes of a request (USB 3.1 section 9.3).
struct Setup {
  std::uint8_t type = 0, request = 0;
  std::uint16_t value = 0, index = 0, length = 0;
  bool in() const { return (type & 0x80) != 0; }
};
Setup parse_setup(std::span<const std::byte, 8> bytes);

/// One thread at a time. Requests that change something are noted in the model's log, in the words of the in-process bus; the model hears of alternate
/// settings, suspension and bus resets.
class ControlEndpoint {
 public:
  ControlEndpoint(DeviceModel& model, Identity identity) : model_(model), identity_(std::move(identity)) {}

  /// What goes back (cut to `setup.length`), empty for requests without data in; nothing when the device stalls. `data` is what came with the request.
  std::optional<std::vector<std::byte>> handle(const Setup& setup, std::span<const std::byte> data);
  /// Whether a request is one by which the host only looks.
  static bool only_looks(const Setup& setup) { return setup.in(); }
  int configuration() const { return configuration_; }

 private:
  std::optional<std::vector<std::byte>> look(const Setup& setup);
  bool change(const Setup& setup, std::span<const std::byte> data);
  bool set_alternate(std::uint16_t interface, std::uint16_t alternate);
  void reset();

  DeviceModel& model_;
  const Identity identity_;
  int configuration_ = 0;
  std::array<std::uint8_t, 2> alternate_{};
};

}  // namespace booth::drivers::kinect2::emulator
