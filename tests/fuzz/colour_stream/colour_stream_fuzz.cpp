// Bulk transfers of the colour stream, framed well or badly around whatever JPEG: only pictures with the expected header are handed on.
#include <algorithm>
#include <cstring>
#include <vector>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/colour_parser.hpp"
#include "drivers/kinect2/layout.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers;
using namespace booth::drivers::kinect2;
using booth::fuzz::Input;
using booth::fuzz::require;

constexpr std::size_t kHeader = 8, kTrailer = 56;

ColourParser& parser() {
  static ColourParser one([](const ColourFrame& frame) {
    require(frame.jpeg.size() >= 4 && frame.jpeg.size() <= kColourMessageBytes, "a picture lies within its message");
    require(is_expected_jpeg(frame.jpeg), "a picture has the expected header");
    require(frame.jpeg[frame.jpeg.size() - 1] == std::byte{0xD9}, "a picture ends with its end marker");
  });
  return one;
}

void send(std::span<const std::byte> message) {
  while (true) {
    const std::size_t n = std::min(message.size(), kColourTransferBytes);
    parser().push(usb::Status::completed, message.first(n), {});
    message = message.subspan(n);
    if (n < kColourTransferBytes) return;
  }
}

/// A message around a JPEG of the input: `fields` says which numbers of the frame are forged.
void send_message(Input& input) {
  static std::vector<std::byte> message(kColourMessageBytes + 2 * kColourTransferBytes);
  static const std::uint8_t start[]{0xFF, 0xD8}, frame[]{0xFF, 0xC0, 0, 17, 8, 0x04, 0x38, 0x07, 0x80, 3, 1, 0x22, 0, 2, 0x11, 1, 3, 0x11, 1};
  const unsigned fields = input.u8();
  std::size_t at = kHeader;
  const auto put = [&](std::span<const std::byte> bytes) {
    if (!bytes.empty()) std::memcpy(message.data() + at, bytes.data(), bytes.size());
    at += bytes.size();
  };
  put(std::as_bytes(std::span(start)));
  if (fields & 1) put(input.bytes(input.u8()));
  if (fields & 2) put(std::as_bytes(std::span(frame)));
  const std::size_t body = static_cast<std::size_t>(input.u8()) << (fields & 4 ? 13 : 2);
  std::fill_n(message.begin() + static_cast<std::ptrdiff_t>(at), body, std::byte{0x11});
  at += body;
  put(input.bytes(input.u8() % 8));
  static const std::byte end[]{std::byte{0xFF}, std::byte{0xD9}};
  if (!(fields & 8)) put(end);
  while (at % 4 != 0) message[at++] = std::byte{0xA5};
  const std::uint32_t filler = 4 * (input.u8() % 64u);
  std::fill_n(message.begin() + static_cast<std::ptrdiff_t>(at), filler, std::byte{0x5A});
  at += filler;
  const auto all = std::span(message).first(at + kTrailer);
  std::fill_n(all.begin() + static_cast<std::ptrdiff_t>(at), kTrailer, std::byte{0});
  write_u32(all, 0, 7);
  write_u32(all, 4, 0x4242'4242);
  write_u32(all, at, 0x3939'3939);
  write_u32(all, at + 4, fields & 16 ? input.u32() : 7);
  write_u32(all, at + 8, fields & 32 ? input.u32() : filler);
  write_u32(all, at + 32, 0x4242'4242);
  write_u32(all, at + 36, fields & 64 ? input.u32() : static_cast<std::uint32_t>(all.size()));
  send(all);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  static const std::vector<std::byte> empty(kColourTransferBytes);
  const auto before = parser().frames() + parser().broken();
  int messages = 0;
  for (; messages < 16 && !input.empty(); ++messages) {
    const unsigned what = input.u8();
    switch (what % 4) {
      case 0:
        send_message(input);
        break;
      case 1:
        parser().push(usb::Status::completed, input.bytes(input.u8()), {});
        break;
      case 2:
        parser().push(usb::Status::completed, empty, {});
        break;
      default:
        parser().push(static_cast<usb::Status>(what / 4 % 7), {}, {});
    }
  }
  require(parser().frames() + parser().broken() - before <= 300u * static_cast<unsigned>(messages), "no more messages end than transfers came");
  parser().push(usb::Status::completed, {}, {});  // ends what was begun: inputs do not depend on each other
  return 0;
}
