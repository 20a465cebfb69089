// Standard requests (USB 3.1 section 9.4), as far as a host sends them to this device.
#include "drivers/kinect2/emulator/control_endpoint.hpp"

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/emulator/device_model.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using Bytes = std::vector<std::byte>;

// Recipient and direction together.
constexpr std::uint8_t kToDevice = 0x00, kToInterface = 0x01, kToEndpoint = 0x02;
constexpr std::uint8_t kFromDevice = 0x80, kFromInterface = 0x81, kFromEndpoint = 0x82;
// Requests (USB 3.1 table 9-5).
constexpr std::uint8_t kGetStatus = 0, kClearFeature = 1, kSetFeature = 3, kGetDescriptor = 6, kGetConfiguration = 8, kSetConfiguration = 9, kGetInterface = 10,
                       kSetInterface = 11, kSetSel = 48, kSetIsochronousDelay = 49;
// Features (USB 3.1 table 9-7).
constexpr std::uint16_t kFunctionSuspend = 0, kEndpointHalt = 0, kU1 = 48, kU2 = 49, kLatencyTolerance = 50;
constexpr std::size_t kSelBytes = 6;

std::string words(const Setup& s) {
  return "control " + std::to_string(s.type) + " " + std::to_string(s.request) + " " + std::to_string(s.value) + " " + std::to_string(s.index);
}

}  // namespace

Setup parse_setup(std::span<const std::byte, 8> bytes) {
  return {.type = std::to_integer<std::uint8_t>(bytes[0]),
          .request = std::to_integer<std::uint8_t>(bytes[1]),
          .value = read_u16(bytes, 2),
          .index = read_u16(bytes, 4),
          .length = read_u16(bytes, 6)};
}

void ControlEndpoint::reset() {
  model_.note("reset");
  model_.bus_reset();
  configuration_ = 0;
  alternate_ = {};
}

std::optional<Bytes> ControlEndpoint::look(const Setup& s) {
  if (s.type == kFromDevice && s.request == kGetDescriptor) {
    // USB/IP keeps the bus reset to itself. A host that begins anew reads the device descriptor's first 8 or 64 bytes; nobody else does.
    const auto type = static_cast<std::uint8_t>(s.value >> 8);
    if (type == kDeviceDescriptor && (s.length == 8 || s.length == 64)) reset();
    return descriptor(identity_, type, static_cast<std::uint8_t>(s.value & 0xFF));
  }
  if (s.type == kFromDevice && s.request == kGetConfiguration) return Bytes{static_cast<std::byte>(configuration_)};
  if (s.type == kFromDevice && s.request == kGetStatus) return Bytes{std::byte{1}, std::byte{0}};  // self powered
  if ((s.type == kFromInterface || s.type == kFromEndpoint) && s.request == kGetStatus) return Bytes(2);
  if (s.type == kFromInterface && s.request == kGetInterface && s.index < alternate_.size()) return Bytes{static_cast<std::byte>(alternate_[s.index])};
  return std::nullopt;
}

bool ControlEndpoint::set_alternate(std::uint16_t interface, std::uint16_t alternate) {
  if (interface >= alternate_.size() || alternate > (interface == kStreamInterface ? 1 : 0)) return false;
  if (alternate == 1 && model_.faults().take(Fault::alternate_refused)) return false;
  alternate_[interface] = static_cast<std::uint8_t>(alternate);
  if (interface == kStreamInterface) model_.set_alternate(alternate);
  return true;
}

bool ControlEndpoint::change(const Setup& s, std::span<const std::byte> data) {
  if (s.type == kToInterface && s.request == kSetInterface) {
    model_.note("alternate " + std::to_string(s.index) + " " + std::to_string(s.value));
    return set_alternate(s.index, s.value);
  }
  model_.note(s.type == kToDevice && s.request == kSetConfiguration ? "configuration" : words(s));
  if (s.type == kToDevice && s.request == kSetConfiguration) {
    if (s.value > 1) return false;
    configuration_ = s.value;
    alternate_ = {};
    model_.set_alternate(0);
    return true;
  }
  const bool feature = s.request == kSetFeature || s.request == kClearFeature;
  if (s.type == kToDevice && feature) return !identity_.high_speed && (s.value == kU1 || s.value == kU2 || s.value == kLatencyTolerance);
  if (s.type == kToInterface && feature && s.value == kFunctionSuspend && (s.index & 0xFF) < alternate_.size()) {
    model_.control({.type = s.type, .request = s.request, .value = s.value, .index = s.index});
    return true;
  }
  if (s.type == kToEndpoint && s.request == kClearFeature) return s.value == kEndpointHalt;
  if (s.type == kToDevice && s.request == kSetSel) return data.size() == kSelBytes;
  return s.type == kToDevice && s.request == kSetIsochronousDelay && s.length == 0;
}

std::optional<Bytes> ControlEndpoint::handle(const Setup& setup, std::span<const std::byte> data) {
  if (!setup.in()) return change(setup, data) ? std::optional(Bytes()) : std::nullopt;
  auto answer = look(setup);
  if (answer && answer->size() > setup.length) answer->resize(setup.length);
  return answer;
}

}  // namespace booth::drivers::kinect2::emulator
