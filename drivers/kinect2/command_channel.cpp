// Packets out, data and completion in.
#include "drivers/kinect2/command_channel.hpp"

#include <algorithm>
#include <cstdio>

#include "drivers/kinect2/bytes.hpp"

namespace booth::drivers::kinect2 {

using namespace std::chrono_literals;

namespace {

constexpr auto kTimeout = 1000ms, kDrainTimeout = 50ms;
constexpr int kMostStale = 8;  ///< answers to earlier commands that are skipped before one's own
constexpr std::size_t kPageBytes = 0x1C0000;

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

void CommandChannel::fail(CommandError::Kind kind, const std::string& what) const {
  throw CommandError(kind, "Kinect v2 " + device_.info().serial + " at port " + device_.info().path + ": " + what);
}

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

std::vector<std::byte> CommandChannel::attempt(Command command, std::span<const std::uint32_t> parameters, std::size_t most_reply, std::size_t least_reply) {
  const std::string name = name_of(command);
  const std::uint32_t transaction = transaction_++;
  const auto check = [&](usb::Status status, const char* what) {
    if (status == usb::Status::completed) return;
    if (status == usb::Status::no_device) fail(CommandError::Kind::gone, "left the bus during " + name);
    if (status == usb::Status::timed_out) fail(CommandError::Kind::timeout, name + ": no " + what + " within a second");
    fail(CommandError::Kind::protocol, name + ": the transfer of its " + what + " failed");
  };
  std::array<std::byte, kRequestHeaderBytes + 4 * kMostParameters> request;
  const std::size_t bytes = write_request(request, transaction, command, parameters, static_cast<std::uint32_t>(most_reply));
  check(device_.bulk_out(kCommandOut, std::span(request).first(bytes), kTimeout).status, "request");

  std::vector<std::byte> data;
  if (most_reply > 0) {
    data.resize(std::max(most_reply, kCompletionBytes));
    Completion completion;
    for (int stale = 0;; ++stale) {
      const auto result = device_.bulk_in(kReplyIn, data, kTimeout);
      check(result.status, "answer");
      const auto got = std::span<const std::byte>(data).first(std::min(result.bytes, data.size()));
      if (!read_completion(got, completion)) {
        data.resize(got.size());
        break;
      }
      if (completion.transaction == transaction)
        fail(CommandError::Kind::premature, name + " completed without data, status " + std::to_string(completion.status));
      if (stale == kMostStale) fail(CommandError::Kind::protocol, name + ": only answers to earlier commands came");
    }
  }
  await_completion(transaction, name);
  if (data.size() < least_reply)
    fail(CommandError::Kind::short_data, name + ": " + std::to_string(data.size()) + " bytes came, " + std::to_string(least_reply) + " are needed");
  return data;
}

void CommandChannel::await_completion(std::uint32_t transaction, const std::string& name) {
  std::array<std::byte, 512> packet;
  for (int stale = 0; stale <= kMostStale; ++stale) {
    const auto result = device_.bulk_in(kReplyIn, packet, kTimeout);
    if (result.status == usb::Status::no_device) fail(CommandError::Kind::gone, "left the bus during " + name);
    if (result.status == usb::Status::timed_out) fail(CommandError::Kind::timeout, name + ": no completion within a second");
    Completion completion;
    if (result.status != usb::Status::completed ||
        !read_completion(std::span<const std::byte>(packet).first(std::min(result.bytes, packet.size())), completion))
      continue;
    if (completion.transaction != transaction) continue;
    if (completion.status != 0) fail(CommandError::Kind::refused, name + " was refused with status " + std::to_string(completion.status));
    return;
  }
  fail(CommandError::Kind::protocol, name + ": no completion of its own among " + std::to_string(kMostStale + 1) + " packets");
}

std::vector<std::byte> CommandChannel::page(Page page, std::size_t most, std::size_t least) {
  const std::array<std::uint32_t, 1> parameter{static_cast<std::uint32_t>(page)};
  return run(Command::read_page, parameter, most, least);
}

namespace {
/// A reply that parses badly is the device's fault: it is named like any other.
template <typename Parse>
auto parsed(const usb::DeviceInfo& info, Parse parse) {
  try {
    return parse();
  } catch (const CommandError&) {
    throw;
  } catch (const std::runtime_error& e) {
    throw CommandError(CommandError::Kind::short_data, "Kinect v2 " + info.serial + " at port " + info.path + ": " + e.what());
  }
}
}  // namespace

std::string CommandChannel::firmware() {
  return parsed(device_.info(), [this] { return parse_firmware(run(Command::versions, {}, 0x200, 64)); });
}
std::string CommandChannel::serial() {
  return parsed(device_.info(), [this] { return parse_serial(page(Page::serial, 0x80, 2)); });
}
DepthCameraParameters CommandChannel::depth_camera() {
  return parsed(device_.info(), [this] { return parse_depth_camera(page(Page::depth_camera, kPageBytes, kDepthCameraBytes)); });
}
PhaseOffsets CommandChannel::phase_offsets() {
  return parsed(device_.info(), [this] { return parse_phase_offsets(page(Page::phase_offsets, kPageBytes, kPhaseTablesBytes)); });
}
ColourCameraParameters CommandChannel::colour_camera() {
  return parsed(device_.info(), [this] { return parse_colour_camera(page(Page::colour_camera, kPageBytes, kColourCameraBytes)); });
}

std::uint32_t CommandChannel::status() {
  const std::array<std::uint32_t, 1> parameter{kStatusParameter};
  return read_u32(run(Command::read_parameter, parameter, 4, 4), 0);
}

void CommandChannel::colour(bool on) {
  const std::array<std::uint32_t, 1> parameter{on ? 1u : 0u};
  (void)run(Command::colour_streaming, parameter, 0, 0);
}

void CommandChannel::reboot() {
  try {
    (void)attempt(Command::reboot, {}, 0, 0);
  } catch (const CommandError& e) {
    if (e.kind() == CommandError::Kind::refused) throw;
  }
}

}  // namespace booth::drivers::kinect2
