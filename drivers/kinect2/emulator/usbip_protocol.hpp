// USB/IP on the wire (Documentation/usb/usbip_protocol.rst of Linux): what the kernel asks of a device, and the form of the answers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <variant>
#include <vector>

namespace booth::drivers::kinect2::emulator::usbip {

inline constexpr std::size_t kHeaderBytes = 48, kIsochronousBytes = 16;
inline constexpr std::uint32_t kMostBytes =
    8u << 20;  ///< of one transfer; 1024 isochronous packets of the longest the kernel takes would be more, none sends them
inline constexpr std::uint32_t kMostPackets = 1024;

/// What came is not USB/IP, or not for this device; the connection is of no use any more.
class ProtocolError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One packet of an isochronous transfer: where it lies in the host's buffer, and what became of it (0 or a negative errno).
struct Packet {
  std::uint32_t offset = 0, length = 0, actual = 0;
  std::int32_t status = 0;
};

struct Submit {
  std::uint32_t sequence = 0;
  bool in = false;
  std::uint8_t endpoint = 0;  ///< without the direction
  std::uint32_t length = 0;   ///< of the host's buffer; with data out, so many bytes follow
  std::uint32_t start_frame = 0;
  std::uint32_t packets = 0;  ///< isochronous: so many descriptors follow (after the data, if any)
  std::array<std::byte, 8> setup{};
};

struct Unlink {
  std::uint32_t sequence = 0, victim = 0;
};

/// Throws ProtocolError, with the field that is wrong.
std::variant<Submit, Unlink> parse_request(std::span<const std::byte, kHeaderBytes> bytes, std::uint32_t device_id);
/// `bytes`: request.packets descriptors. Throws ProtocolError where one lies outside of the buffer.
std::vector<Packet> parse_packets(std::span<const std::byte> bytes, const Submit& request);

std::array<std::byte, kHeaderBytes> submit_reply(const Submit& request, std::int32_t status, std::uint32_t actual, std::uint32_t broken_packets = 0);
std::array<std::byte, kHeaderBytes> unlink_reply(const Unlink& request, std::int32_t status);
/// Appends the descriptor.
void append(std::vector<std::byte>& out, const Packet& packet);

}  // namespace booth::drivers::kinect2::emulator::usbip
