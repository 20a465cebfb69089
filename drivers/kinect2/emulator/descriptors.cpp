// Descriptors byte by byte; the fields are named where their value means something.
#include "drivers/kinect2/emulator/descriptors.hpp"

#include <initializer_list>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using Bytes = std::vector<std::byte>;

constexpr unsigned kMaker = 1, kProduct = 2, kSerial = 3;  // numbers of the strings

void append(Bytes& out, std::initializer_list<unsigned> bytes) {
  for (const unsigned b : bytes) out.push_back(static_cast<std::byte>(b));
}
unsigned low(unsigned v) { return v & 0xFF; }
unsigned high(unsigned v) { return v >> 8; }

Bytes device(const Identity& identity) {
  Bytes out;
  const unsigned version = identity.high_speed ? 0x0210 : 0x0300, packet = identity.high_speed ? 64 : 9;  // SuperSpeed: a power of two
  append(out, {18, kDeviceDescriptor, low(version), high(version), 0xEF, 2, 1, packet});
  append(out, {low(kDeviceIds[0].first), high(kDeviceIds[0].first), low(kDeviceIds[0].second), high(kDeviceIds[0].second), 0x00, 0x01});
  append(out, {kMaker, kProduct, kSerial, 1});
  return out;
}

/// An endpoint and, at SuperSpeed, the companion that must follow it (USB 3.1 section 9.6.7).
struct Endpoint {
  unsigned address, attributes, packet, interval, burst, multiplier, bytes_per_interval;
};

void append(Bytes& out, const Identity& identity, const Endpoint& e) {
  append(out, {7, 5, e.address, e.attributes, low(e.packet), high(e.packet), e.interval});
  if (!identity.high_speed) append(out, {6, 0x30, e.burst, e.multiplier, low(e.bytes_per_interval), high(e.bytes_per_interval)});
}

Bytes configuration(const Identity& identity) {
  constexpr unsigned kBulk = 2, kInterrupt = 3, kIsochronousAsynchronous = 5, kVendor = 0xFF, kAudio = 1;
  const unsigned bulk = identity.high_speed ? 512 : 1024;
  Bytes out;
  append(out, {9, kConfigurationDescriptor, 0, 0, 2, 1, 0, 0xC0, identity.high_speed ? 72u : 18u});  // value 1, self powered, 144 mA
  append(out, {8, 0x0B, 0, identity.high_speed ? 1u : 2u, kVendor, kVendor, 0, 0});
  append(out, {9, 4, kControlInterface, 0, 4, kVendor, 0, 0, 0});
  append(out, identity, {kReplyIn, kBulk, bulk, 0, 15, 0, 0});
  append(out, identity, {kCommandOut, kBulk, bulk, 0, 15, 0, 0});
  append(out, identity, {kColourIn, kBulk, bulk, 0, 15, 0, 0});
  append(out, identity, {0x82, kInterrupt, 64, 8, 0, 0, 64});
  if (identity.high_speed) {
    // In a USB 2 port interface 1 belongs to the microphones.
    append(out, {9, 4, kStreamInterface, 0, 0, kAudio, 1, 0, 0});
  } else {
    append(out, {9, 4, kStreamInterface, 0, 0, kVendor, 0, 0, 0});
    append(out, {9, 4, kStreamInterface, 1, 1, kVendor, 0, 0, 0});
    append(out, identity, {kInfraredIn, kIsochronousAsynchronous, 1024, 1, 10, 2, identity.bytes_per_interval});  // 11 packets, three times
  }
  write_u16(out, 2, static_cast<std::uint16_t>(out.size()));
  return out;
}

/// Capabilities: link power management of USB 2, and SuperSpeed only with exit latencies of 10 and 2047 microseconds (USB 3.1 section 9.6.2).
Bytes bos() {
  Bytes out;
  append(out, {5, kBosDescriptor, 22, 0, 2});
  append(out, {7, 0x10, 2, 0x02, 0, 0, 0});
  append(out, {10, 0x10, 3, 0, 0x08, 0, 3, 10, 0xFF, 0x07});
  return out;
}

Bytes text(const std::string& ascii) {
  Bytes out;
  append(out, {static_cast<unsigned>(2 + 2 * std::min<std::size_t>(ascii.size(), 126)), kStringDescriptor});
  for (std::size_t i = 0; i < ascii.size() && i < 126; ++i)
    append(out, {static_cast<unsigned char>(ascii[i]) < 128u ? static_cast<unsigned>(ascii[i]) : '?', 0});
  return out;
}

}  // namespace

std::optional<Bytes> descriptor(const Identity& identity, std::uint8_t type, std::uint8_t index) {
  switch (type) {
    case kDeviceDescriptor:
      return device(identity);
    case kConfigurationDescriptor:
      if (index != 0) return std::nullopt;
      return configuration(identity);
    case kBosDescriptor:
      return bos();
    case kStringDescriptor:
      if (index == 0) return Bytes{std::byte{4}, std::byte{kStringDescriptor}, std::byte{0x09}, std::byte{0x04}};  // English
      if (index == kMaker) return text("Microsoft");
      if (index == kProduct) return text(identity.product_string);
      if (index == kSerial) return text(identity.serial);
      return std::nullopt;
    default:
      return std::nullopt;
  }
}

}  // namespace booth::drivers::kinect2::emulator
