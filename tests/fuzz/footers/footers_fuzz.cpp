// Whole images with forged footers: indices, sequences and time stamps as a broken device may send them, on into the mapping of time.
#include <memory>
#include <vector>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/device_time.hpp"
#include "drivers/kinect2/infrared_parser.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::drivers;
using namespace booth::drivers::kinect2;
using booth::fuzz::Input;
using booth::fuzz::require;

struct Run {
  DeviceTime time;
  booth::hal::MonotonicTime last = booth::hal::MonotonicTime::min();
};
Run run;

InfraredParser& parser() {
  static InfraredParser one([](const RawFrame& frame) {
    const auto at = run.time.to_host(frame.timestamp, frame.arrived);
    require(at <= frame.arrived, "nothing is captured after it arrived");
    require(at > run.last, "time goes on");
    run.last = at;
  });
  return one;
}

void push_image(std::uint32_t timestamp, std::uint32_t sequence, std::uint32_t index, std::uint32_t length, booth::hal::MonotonicTime now) {
  static std::vector<std::byte> image(kSubImageBytes);
  write_u32(image, kImageBytes + 8, timestamp);
  write_u32(image, kImageBytes + 12, sequence);
  write_u32(image, kImageBytes + 16, index);
  write_u32(image, kImageBytes + 20, length);
  const std::span<const std::byte> all(image);
  for (std::size_t at = 0; at < kSubImageBytes; at += kPacketBytes)
    parser().push(usb::Status::completed, all.subspan(at, std::min(kPacketBytes, kSubImageBytes - at)), now);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  parser().reset();
  run = Run();
  std::uint32_t sequence = input.u32(), ticks = input.u32();
  booth::hal::MonotonicTime now{std::chrono::hours(1)};
  for (int steps = 0; steps < 48 && !input.empty(); ++steps) {
    const unsigned what = input.u8();
    const std::uint32_t length = what & 0x40 ? input.u32() : static_cast<std::uint32_t>(kImageBytes);
    if (what & 0x10) sequence = what & 0x20 ? input.u32() : sequence + 1;
    if (what & 0x80) ticks = input.u32();
    ticks += 266;
    now += std::chrono::microseconds(33'250);
    if ((what & 15) < 12) {  // a whole frame, images in order
      for (std::uint32_t i = 0; i < 10; ++i) push_image(ticks, sequence, i, length, now);
      ++sequence;
    } else {
      push_image(ticks, sequence, (what & 15) == 15 ? input.u32() : input.u8() % 12, length, now + std::chrono::nanoseconds(input.u32()));
      now += std::chrono::seconds(5);  // beyond any delay above
    }
  }
  return 0;
}
