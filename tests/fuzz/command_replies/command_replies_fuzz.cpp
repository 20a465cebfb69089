// A device that answers commands with whatever it likes: the channel throws CommandError or returns what it promises, after a bounded number of transfers.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/command_channel.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers;
using namespace booth::drivers::kinect2;
using booth::fuzz::Input;
using booth::fuzz::require;

/// Each answer of the input: how it ends and what it holds; time-outs for ever when the input is used up.
class Liar final : public usb::Device {
 public:
  explicit Liar(Input& input) : input_(input) {}
  int transfers = 0;

  const usb::DeviceInfo& info() const override { return info_; }
  int configuration() override { return 1; }
  void set_configuration(int) override {}
  void claim(int) override {}
  void release(int) noexcept override {}
  void set_alternate(int, int) override {}
  std::size_t bytes_per_interval(int, int, std::uint8_t) override { return kPacketBytes; }
  void control_out(const usb::ControlRequest&, std::span<const std::byte>, booth::hal::Nanoseconds) override {}
  void reset() override {}
  std::unique_ptr<usb::Stream> open_stream(const usb::StreamSettings&, usb::StreamSink&) override { throw usb::Error(usb::Fault::unsupported, "no streams"); }

  usb::TransferResult bulk_out(std::uint8_t endpoint, std::span<const std::byte> data, booth::hal::Nanoseconds) override {
    ++transfers;
    require(endpoint == kCommandOut && data.size() >= kRequestHeaderBytes && data.size() <= kRequestHeaderBytes + 4 * kMostParameters && data.size() % 4 == 0,
            "a request has 20 to 36 bytes");
    require(read_u32(data, 0) == kRequestMagic, "a request begins with its magic");
    transaction_ = read_u32(data, 4);
    most_ = read_u32(data, 8);
    return {usb::Status::completed, data.size()};
  }

  usb::TransferResult bulk_in(std::uint8_t endpoint, std::span<std::byte> data, booth::hal::Nanoseconds) override {
    require(endpoint == kReplyIn, "answers are read from the endpoint of replies");
    require(++transfers < 1000, "the number of transfers of a command is bounded");
    if (input_.empty()) return {usb::Status::timed_out, 0};
    const unsigned kind = input_.u8();
    switch (kind % 8) {
      case 0:  // a completion of its own
      case 1:  // of an earlier or later command
        return completion(data, transaction_ + (kind % 8 == 1 ? input_.u8() - 128u : 0u), kind & 8 ? input_.u32() : 0);
      case 2: {  // as many bytes as were asked for, more or less, made from a seed
        const std::size_t bytes = std::min(data.size(), static_cast<std::size_t>(most_) - std::min<std::size_t>(most_, input_.u8()));
        booth::fuzz::fill(data.first(bytes), input_.u8());
        return {usb::Status::completed, bytes};
      }
      case 3:  // ends badly
        return {static_cast<usb::Status>(1 + input_.u8() % 6), 0};
      case 4: {  // reports more than there is room for
        return {usb::Status::completed, data.size() + input_.u16()};
      }
      case 5: {  // the beginning from the input, zeros behind it
        const std::size_t bytes = std::min<std::size_t>(data.size(), most_);
        std::fill(data.begin(), data.end(), std::byte{0});
        copy(data.first(bytes), input_.bytes(input_.u8()));
        return {usb::Status::completed, bytes};
      }
      default: {  // the input itself
        const auto bytes = input_.bytes(input_.u8());
        return {usb::Status::completed, copy(data, bytes)};
      }
    }
  }

 private:
  static std::size_t copy(std::span<std::byte> to, std::span<const std::byte> from) {
    const std::size_t n = std::min(to.size(), from.size());
    if (n > 0) std::memcpy(to.data(), from.data(), n);
    return n;
  }
  static usb::TransferResult completion(std::span<std::byte> data, std::uint32_t transaction, std::uint32_t status) {
    if (data.size() < kCompletionBytes) return {usb::Status::overflow, 0};
    write_u32(data, 0, kCompletionMagic);
    write_u32(data, 4, transaction);
    write_u32(data, 8, status);
    write_u32(data, 12, 0);
    return {usb::Status::completed, kCompletionBytes};
  }

  Input& input_;
  const usb::DeviceInfo info_{.vendor = 0x045E, .product = 0x02C4, .speed = usb::Speed::super, .path = "1-1", .serial = "1"};
  std::uint32_t transaction_ = 0, most_ = 0;
};

void ask(CommandChannel& channel, unsigned what) {
  switch (what % 10) {
    case 0:
      require(!channel.firmware().empty(), "a firmware has a name");
      break;
    case 1:
      for (const char c : channel.serial()) require(std::isalnum(static_cast<unsigned char>(c)) != 0, "a serial has letters and digits only");
      break;
    case 2: {
      const auto p = channel.depth_camera();
      require(p.fx >= 300 && p.fx <= 450 && p.cy >= 150 && p.cy <= 280 && std::isfinite(p.k3), "a lens is in range");
      break;
    }
    case 3:
      for (const auto& table : channel.phase_offsets().p0) require(table.size() == kPixels, "a phase table has every pixel");
      break;
    case 4:
      require(std::isfinite(channel.colour_camera().x[9]), "colour parameters are finite");
      break;
    case 5:
      (void)channel.status();
      break;
    case 6:
      channel.start_infrared();
      break;
    case 7:
      channel.stop_infrared();
      break;
    case 8:
      channel.colour(true);
      break;
    default:
      channel.reboot();
      break;
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  Liar device(input);
  CommandChannel channel(device);
  for (int command = 0; command < 4 && !input.empty(); ++command) {
    const unsigned what = input.u8();
    device.transfers = 0;
    try {
      ask(channel, what);
    } catch (const CommandError& e) {
      require(e.what()[0] != '\0', "an error says what is wrong");
    }
  }
  return 0;
}
