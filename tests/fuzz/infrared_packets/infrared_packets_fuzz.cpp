// Isochronous packets of any length, status and order: the parser hands on frames that are whole, and counts the rest.
#include <algorithm>
#include <memory>
#include <vector>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/infrared_parser.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers;
using namespace booth::drivers::kinect2;
using booth::fuzz::Input;
using booth::fuzz::require;

constexpr std::size_t kLastPacketBytes = kSubImageBytes - 8 * kPacketBytes;

/// A stream made from instructions, so that an input of a few bytes can be a whole frame.
class Stream {
 public:
  explicit Stream(InfraredParser& parser) : parser_(parser) {}
  void step(Input& input) {
    const unsigned what = input.u8();
    switch (what % 8) {
      case 0:  // full packets
        for (unsigned i = 0; i < what / 8 % 16; ++i) push(kPacketBytes);
        break;
      case 1:
        last(input, kLastPacketBytes);
        break;
      case 2:  // empty packets
        for (unsigned i = 0; i < what / 8; ++i) push(0);
        break;
      case 3:
        parser_.push(static_cast<usb::Status>(1 + what / 8 % 6), std::span(packet_).first(input.u16() % (kPacketBytes + 1)), now_);
        break;
      case 4:
        push(std::min<std::size_t>(input.u16(), packet_.size()));
        break;  // also longer than a device may send
      case 5:
        last(input, std::min<std::size_t>(kPacketBytes, kLastPacketBytes + input.u8() - 128));
        break;
      case 6:  // a whole image
        for (int i = 0; i < 8; ++i) push(kPacketBytes);
        last(input, kLastPacketBytes);
        break;
      default:
        if (what / 8 == 0)
          parser_.reset();
        else
          now_ += std::chrono::milliseconds(what);
    }
  }

 private:
  void push(std::size_t bytes) { parser_.push(usb::Status::completed, std::span<const std::byte>(packet_).first(bytes), now_); }
  void last(Input& input, std::size_t bytes) {
    const std::size_t at = bytes - kFooterBytes;
    const std::uint8_t fields = input.u8();  // low half: the index; high half: which of the others are forged
    if (fields & 0x10) ++sequence_;
    write_u32(packet_, at + 8, fields & 0x20 ? input.u32() : 266 * sequence_);
    write_u32(packet_, at + 12, fields & 0x40 ? input.u32() : sequence_);
    write_u32(packet_, at + 16, (fields & 0x90) == 0x90 ? input.u32() : fields & 15u);
    write_u32(packet_, at + 20, (fields & 0x80) != 0 && (fields & 0x10) == 0 ? input.u32() : static_cast<std::uint32_t>(kImageBytes));
    push(bytes);
  }

  InfraredParser& parser_;
  std::vector<std::byte> packet_ = std::vector<std::byte>(3 * kPacketBytes);
  std::uint32_t sequence_ = 0;
  booth::hal::MonotonicTime now_{std::chrono::seconds(1)};
};

std::uint64_t frames = 0;

InfraredParser& parser() {
  static InfraredParser one([](const RawFrame& frame) {
    ++frames;
    require((frame.image_mask & kNeededImages) == kNeededImages && frame.image_mask < 1u << kImages, "a frame has its nine images and no eleventh");
    require(frame.images.size() == kFrameBytes, "a frame has room for ten images");
  });
  return one;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  parser().reset();
  frames = 0;
  const auto before = parser().counters();
  Stream stream(parser());
  for (int steps = 0; steps < 64 && !input.empty(); ++steps) stream.step(input);
  const auto after = parser().counters();
  require(after.frames - before.frames == frames, "every frame that is counted was handed on");
  require(after.lost_images - before.lost_images < 100'000, "no image is lost that was never begun");
  return 0;
}
