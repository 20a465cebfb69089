// What an emulated sensor says of itself when the bus asks: the descriptors of USB.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace booth::drivers::kinect2::emulator {

/// How a device introduces itself; the defaults are a good sensor in a USB 3 port.
struct Identity {
  std::string serial;
  bool high_speed = false;                    ///< as in a USB 2 port: no SuperSpeed companions, no stream interface
  std::uint16_t bytes_per_interval = 33'792;  ///< wBytesPerInterval of the infrared endpoint
  std::string product_string = "Xbox NUI Sensor";
};

// Types of descriptors (USB 3.1 table 9-6).
inline constexpr std::uint8_t kDeviceDescriptor = 1, kConfigurationDescriptor = 2, kStringDescriptor = 3, kBosDescriptor = 15;

/// Whole, not yet cut to what was asked for; nothing where the device has no such descriptor and stalls (USB 3.1 section 9.4.3). Strings: 0 languages,
/// 1 maker, 2 product, 3 serial; text is ASCII, other characters become '?'.
std::optional<std::vector<std::byte>> descriptor(const Identity& identity, std::uint8_t type, std::uint8_t index);

}  // namespace booth::drivers::kinect2::emulator
