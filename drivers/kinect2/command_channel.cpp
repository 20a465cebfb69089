// Packets out, data and completion in.
#include "drivers/kinect2/command_channel.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "drivers/kinect2/bytes.hpp"

namespace booth::drivers::kinect2 {

using namespace std::chrono_literals;

namespace {

constexpr auto kTimeout = 1000ms, kDrainTimeout = 50ms;
constexpr int kMostPackets = 10;              ///< one's own two, and what earlier commands may have left behind
constexpr std::size_t kPacket = 1024;         ///< of a SuperSpeed bulk endpoint; a read of less could be too small for what is queued
constexpr std::size_t kPageBytes = 0x1C0000;  ///< more than any page has

std::size_t whole_packets(std::size_t bytes) { return std::max(kPacket, (bytes + kPacket - 1) / kPacket * kPacket); }

std::string name_of(Command command) {
  char text[24];
  std::snprintf(text, sizeof text, "command 0x%02x", static_cast<unsigned>(command));
  return text;
}

}  // namespace

std::size_t write_request(std::span<std::byte> out, std::uint32_t transaction, Command command, std::span<const std::uint32_t> parameters,
                          std::uint32_t most_reply) {
  const std::size_t bytes = kRequestHeaderBytes + 4 * parameters.size();
  if (parameters.size() > kMostParameters || out.size() < bytes) throw std::invalid_argument("a command has at most four parameters");
  write_u32(out, 0, kRequestMagic);
  write_u32(out, 4, transaction);
  write_u32(out, 8, most_reply);
  write_u32(out, 12, static_cast<std::uint32_t>(command));
  write_u32(out, 16, 0);
  for (std::size_t i = 0; i < parameters.size(); ++i) write_u32(out, kRequestHeaderBytes + 4 * i, parameters[i]);
  return bytes;
}

bool read_completion(std::span<const std::byte> bytes, Completion& out) {
  if (bytes.size() != kCompletionBytes || read_u32(bytes, 0) != kCompletionMagic) return false;
  out = {.transaction = read_u32(bytes, 4), .status = read_u32(bytes, 8)};
  return true;
}

std::string CommandChannel::name() const { return "Kinect v2 " + device_.info().serial + " at port " + device_.info().path; }

void CommandChannel::fail(CommandError::Kind kind, const std::string& what) const { throw CommandError(kind, name() + ": " + what); }

void CommandChannel::drain() {
  std::array<std::byte, 16'384> scrap;
  for (int i = 0; i < 128; ++i)  // 128 x 16 KiB is more than the longest answer
    if (device_.bulk_in(kReplyIn, scrap, kDrainTimeout).status != usb::Status::completed) return;
}

std::vector<std::byte> CommandChannel::run(Command command, std::span<const std::uint32_t> parameters, std::size_t most_reply, std::size_t least_reply) {
  try {
    return attempt(command, parameters, most_reply, least_reply);
  } catch (const CommandError& e) {
    if (e.kind() != CommandError::Kind::timeout && e.kind() != CommandError::Kind::protocol) throw;
  }
  drain();
  return attempt(command, parameters, most_reply, least_reply);
}

void CommandChannel::require(usb::Status status, const std::string& what) const {
  if (status == usb::Status::completed) return;
  if (status == usb::Status::no_device) fail(CommandError::Kind::gone, "left the bus during " + what);
  if (status == usb::Status::timed_out) fail(CommandError::Kind::timeout, "no answer within a second to " + what);
  fail(CommandError::Kind::protocol, "a transfer failed during " + what);
}

std::vector<std::byte> CommandChannel::attempt(Command command, std::span<const std::uint32_t> parameters, std::size_t most_reply, std::size_t least_reply) {
  const std::string name = name_of(command);
  const std::uint32_t transaction = transaction_++;
  std::array<std::byte, kRequestHeaderBytes + 4 * kMostParameters> request;
  const std::size_t bytes = write_request(request, transaction, command, parameters, static_cast<std::uint32_t>(most_reply));
  require(device_.bulk_out(kCommandOut, std::span(request).first(bytes), kTimeout).status, name);
  return answer(transaction, name, most_reply, least_reply);
}

std::vector<std::byte> CommandChannel::answer(std::uint32_t transaction, const std::string& name, std::size_t most_reply, std::size_t least_reply) {
  std::vector<std::byte> packet(whole_packets(most_reply)), data;
  bool with_data = false;
  for (int packets = 0; packets < kMostPackets; ++packets) {
    const auto result = device_.bulk_in(kReplyIn, packet, kTimeout);
    require(result.status, name);
    const auto got = std::span<const std::byte>(packet).first(std::min(result.bytes, packet.size()));
    Completion completion;
    if (!read_completion(got, completion)) {
      if (got.empty() && with_data) continue;  // ends data of whole packets
      with_data = true;
      packet.resize(got.size());
      data = std::exchange(packet, std::vector<std::byte>(kPacket));
    } else if (completion.transaction != transaction) {
      // The answer to an earlier command, which was given up; data before it were that command's.
      with_data = false;
      packet.resize(whole_packets(most_reply));
    } else {
      if (completion.status != 0) fail(CommandError::Kind::refused, name + " was refused with status " + std::to_string(completion.status));
      if (most_reply > 0 && !with_data) fail(CommandError::Kind::premature, name + " completed without data");
      if (data.size() < least_reply)
        fail(CommandError::Kind::short_data, name + ": " + std::to_string(data.size()) + " bytes came, " + std::to_string(least_reply) + " are needed");
      return data;
    }
  }
  fail(CommandError::Kind::protocol, name + ": no completion of its own among " + std::to_string(kMostPackets) + " packets");
}

std::vector<std::byte> CommandChannel::page(Page page, std::size_t most, std::size_t least) {
  const std::array<std::uint32_t, 1> parameter{static_cast<std::uint32_t>(page)};
  return run(Command::read_page, parameter, most, least);
}

/// A reply that parses badly is the device's fault: it is named like any other.
template <typename Parse>
auto CommandChannel::parsed(Parse parse) const {
  try {
    return parse();
  } catch (const CommandError&) {
    throw;
  } catch (const std::runtime_error& e) {
    fail(CommandError::Kind::short_data, e.what());
  }
}

std::string CommandChannel::firmware() {
  return parsed([this] { return parse_firmware(run(Command::versions, {}, 0x200, 64)); });
}
std::string CommandChannel::serial() {
  return parsed([this] { return parse_serial(page(Page::serial, 0x80, 2)); });
}
std::string CommandChannel::board() { return parse_board(run(Command::hardware_info, {}, kHardwareBytes, kHardwareBytes)); }
DepthCameraParameters CommandChannel::depth_camera() {
  return parsed([this] { return parse_depth_camera(page(Page::depth_camera, kDepthCameraBytes, kDepthCameraBytes)); });
}
PhaseOffsets CommandChannel::phase_offsets() {
  // The tables alone: what follows them is not used, and the kernel counts the buffer against what all cameras together may have in flight. A device that
  // does not shorten its answers is asked again with room for everything.
  std::vector<std::byte> reply;
  try {
    reply = page(Page::phase_offsets, kPhaseTablesBytes, kPhaseTablesBytes);
  } catch (const CommandError& e) {
    if (e.kind() != CommandError::Kind::protocol) throw;
    drain();
    reply = page(Page::phase_offsets, kPageBytes, kPhaseTablesBytes);
  }
  if (const std::string remark = unusual_phase_header(reply); !remark.empty()) note(notes_, Gravity::info, name() + ": " + remark);
  return parsed([&] { return parse_phase_offsets(reply); });
}
ColourCameraParameters CommandChannel::colour_camera() {
  return parsed([this] { return parse_colour_camera(page(Page::colour_camera, kColourCameraBytes, kColourCameraBytes)); });
}

std::uint32_t CommandChannel::status() {
  const std::array<std::uint32_t, 1> parameter{kStatusParameter};
  return read_u32(run(Command::read_parameter, parameter, 4, 4), 0);
}

void CommandChannel::colour(bool on) {
  const std::array<std::uint32_t, 1> parameter{on ? 1u : 0u};
  (void)run(Command::colour_streaming, parameter, 0, 0);
}

void CommandChannel::light(int led, int level) {
  const auto brightness = static_cast<std::uint32_t>(std::clamp(level, 0, 1000));
  // Light and mode (0: steady), both levels, the interval of blinking.
  const std::array<std::uint32_t, 4> parameters{static_cast<std::uint32_t>(led) & 1u, brightness | brightness << 16, 0, 0};
  (void)run(Command::light, parameters, 0, 0);
}

void CommandChannel::reboot() {
  try {
    (void)attempt(Command::reboot, {}, 0, 0);
  } catch (const CommandError& e) {
    if (e.kind() == CommandError::Kind::refused) throw;
  }
}

}  // namespace booth::drivers::kinect2
