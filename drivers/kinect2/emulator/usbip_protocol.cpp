// Big-endian fields, each checked before anybody relies on it.
#include "drivers/kinect2/emulator/usbip_protocol.hpp"

#include <string>

namespace booth::drivers::kinect2::emulator::usbip {
namespace {

constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitted = 3, kUnlinked = 4;
constexpr std::uint32_t kNotIsochronous = 0xFFFF'FFFF;

std::uint32_t read(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t v = 0;
  for (std::size_t i = 0; i < 4; ++i) v = v << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
  return v;
}
void write(std::span<std::byte> bytes, std::size_t at, std::uint32_t v) {
  for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::byte>(v >> (24 - 8 * i) & 0xFF);
}

[[noreturn]] void refuse(const char* field, std::uint32_t value) {
  throw ProtocolError(std::string("USB/IP: ") + field + " is " + std::to_string(value) + ", the connection is given up");
}

Submit parse_submit(std::span<const std::byte, kHeaderBytes> bytes) {
  Submit out{.sequence = read(bytes, 4),
             .in = read(bytes, 12) != 0,
             .endpoint = static_cast<std::uint8_t>(read(bytes, 16)),
             .length = read(bytes, 24),
             .start_frame = read(bytes, 28),
             .packets = read(bytes, 32)};
  if (out.length > kMostBytes) refuse("the length of a transfer", out.length);
  if (out.packets == kNotIsochronous) out.packets = 0;
  if (out.packets > kMostPackets) refuse("the number of packets of a transfer", out.packets);
  for (std::size_t i = 0; i < out.setup.size(); ++i) out.setup[i] = bytes[40 + i];
  return out;
}

}  // namespace

std::variant<Submit, Unlink> parse_request(std::span<const std::byte, kHeaderBytes> bytes, std::uint32_t device_id) {
  const std::uint32_t command = read(bytes, 0);
  if (command != kSubmit && command != kUnlink) refuse("the command", command);
  if (read(bytes, 8) != device_id) refuse("the device", read(bytes, 8));
  if (read(bytes, 12) > 1) refuse("the direction", read(bytes, 12));
  if (read(bytes, 16) > 15) refuse("the endpoint", read(bytes, 16));
  if (command == kUnlink) return Unlink{.sequence = read(bytes, 4), .victim = read(bytes, 20)};
  return parse_submit(bytes);
}

std::vector<Packet> parse_packets(std::span<const std::byte> bytes, const Submit& request) {
  if (bytes.size() != request.packets * kIsochronousBytes) throw ProtocolError("USB/IP: descriptors of packets are missing");
  std::vector<Packet> out(request.packets);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto one = bytes.subspan(i * kIsochronousBytes, kIsochronousBytes);
    out[i] = {.offset = read(one, 0), .length = read(one, 4)};
    if (out[i].offset > request.length || out[i].length > request.length - out[i].offset) refuse("the place of a packet", out[i].offset);
  }
  return out;
}

std::array<std::byte, kHeaderBytes> submit_reply(const Submit& request, std::int32_t status, std::uint32_t actual, std::uint32_t broken_packets) {
  std::array<std::byte, kHeaderBytes> out{};
  write(out, 0, kSubmitted);
  write(out, 4, request.sequence);
  write(out, 20, static_cast<std::uint32_t>(status));
  write(out, 24, actual);
  write(out, 28, request.start_frame);
  write(out, 32, request.packets == 0 ? kNotIsochronous : request.packets);
  write(out, 36, broken_packets);
  return out;
}

std::array<std::byte, kHeaderBytes> unlink_reply(const Unlink& request, std::int32_t status) {
  std::array<std::byte, kHeaderBytes> out{};
  write(out, 0, kUnlinked);
  write(out, 4, request.sequence);
  write(out, 20, static_cast<std::uint32_t>(status));
  return out;
}

void append(std::vector<std::byte>& out, const Packet& packet) {
  const std::size_t at = out.size();
  out.resize(at + kIsochronousBytes);
  write(out, at, packet.offset);
  write(out, at + 4, packet.length);
  write(out, at + 8, packet.actual);
  write(out, at + 12, static_cast<std::uint32_t>(packet.status));
}

}  // namespace booth::drivers::kinect2::emulator::usbip
