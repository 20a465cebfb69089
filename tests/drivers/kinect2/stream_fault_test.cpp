// What each fault of the streams costs, frame by frame: from the emulated device straight into the parsers, without threads or clocks.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/colour_parser.hpp"
#include "drivers/kinect2/emulator/colour_source.hpp"
#include "drivers/kinect2/emulator/device_model.hpp"
#include "drivers/kinect2/infrared_parser.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;
using emulator::Fault;

emulator::EmulatedDeviceSettings still_device() {
  return {.camera = emulator::typical_camera(), .still = true, .view = [](hal::MonotonicTime, std::span<float> depth, std::span<float> infrared) {
            std::fill(depth.begin(), depth.end(), 2000.0f);
            std::fill(infrared.begin(), infrared.end(), 5000.0f);
          }};
}

/// What ten frames, with a fault in the third, leave behind.
struct Cost {
  std::uint64_t frames = 10, incomplete = 0, lost_frames = 0, lost_images = 0, broken_packets = 0, bad_footers = 0;
};

struct FaultCost {
  Fault fault;
  const char* name;
  int after;  ///< opportunities (packets, images or frames) that are let pass first
  Cost cost;
};

constexpr int kPacketsOfFrame = 90, kImagesOfFrame = 10;
constexpr int kThird = 2 * kPacketsOfFrame + 30, kThirdImage = 2 * kImagesOfFrame + 3;

class InfraredFault : public testing::TestWithParam<FaultCost> {};

TEST_P(InfraredFault, CostsTheFrameConcernedAndNothingElse) {
  emulator::DeviceModel model(still_device());
  std::vector<std::byte> whole(kFrameBytes);
  model.render({}, 0, whole);
  bool same = true;
  InfraredParser parser([&](const RawFrame& frame) {
    same = same && std::equal(frame.images.begin(), frame.images.begin() + 9 * kImageBytes, whole.begin());
    EXPECT_EQ(frame.image_mask & kNeededImages, kNeededImages);
  });
  emulator::InfraredSource source(model);
  model.faults().inject(GetParam().fault, 1, GetParam().after);
  for (int i = 0; i < 10; ++i)
    source.send_frame(hal::MonotonicTime(i * 33ms), [&](usb::Status status, std::span<const std::byte> data) {
      parser.push(status, data, {});
      return true;
    });
  const auto seen = parser.counters();
  const Cost& cost = GetParam().cost;
  EXPECT_EQ(seen.frames, cost.frames);
  EXPECT_EQ(seen.incomplete_frames, cost.incomplete);
  EXPECT_EQ(seen.lost_frames, cost.lost_frames);
  EXPECT_EQ(seen.lost_images, cost.lost_images);
  EXPECT_EQ(seen.broken_packets, cost.broken_packets);
  EXPECT_EQ(seen.bad_footers, cost.bad_footers);
  EXPECT_TRUE(same) << "a frame was handed on that the device did not send";
}

constexpr Cost kOneFrame{.frames = 9, .incomplete = 1, .lost_images = 1};
constexpr Cost kOneFooter{.frames = 9, .incomplete = 1, .bad_footers = 1};

INSTANTIATE_TEST_SUITE_P(
    Stream, InfraredFault,
    testing::Values(FaultCost{Fault::packet_lost, "APacketLost", kThird, kOneFrame},
                    FaultCost{Fault::packet_error, "APacketBroken", kThird, {.frames = 9, .incomplete = 1, .lost_images = 1, .broken_packets = 1}},
                    FaultCost{Fault::packet_error,
                              "TheFirstPacketOfAnImageBroken",
                              2 * kPacketsOfFrame + 27,
                              {.frames = 9, .incomplete = 1, .lost_images = 1, .broken_packets = 1}},
                    FaultCost{Fault::packet_truncated, "APacketTruncated", kThird, {.frames = 9, .incomplete = 1, .lost_images = 2}},
                    FaultCost{Fault::last_packet_lost, "AShortPacketLost", kThirdImage, kOneFrame},
                    FaultCost{Fault::last_packet_lost, "TheShortPacketOfTheDarkImageLost", 2 * kImagesOfFrame + 9, {.lost_images = 1}},
                    FaultCost{Fault::empty_packets, "ThreeEmptyPacketsInsideAnImage", kThird, {}},
                    FaultCost{Fault::footer_length, "AWrongFooterLength", kThirdImage, kOneFooter},
                    FaultCost{Fault::footer_index_ten, "IndexTen", kThirdImage, kOneFooter},
                    FaultCost{Fault::footer_index_31, "Index31", kThirdImage, kOneFooter},
                    FaultCost{Fault::footer_index_32, "Index32", kThirdImage, kOneFooter},
                    FaultCost{Fault::footer_index_huge, "AHugeIndex", kThirdImage, kOneFooter},
                    FaultCost{Fault::image_missing, "AnImageMissing", 2 * 9 + 3, {.frames = 9, .incomplete = 1}},
                    FaultCost{Fault::sequence_jump, "TheFrameNumberJumps", 2, {}}, FaultCost{Fault::sequence_repeat, "TheFrameNumberRepeats", 2, {}},
                    FaultCost{Fault::sequence_wraps, "TheFrameNumberWraps", 2, {}}, FaultCost{Fault::time_jump, "TheTimeStampJumps", 2, {}}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(InfraredParser, AnErrorBetweenTwoImagesCostsNothing) {
  emulator::DeviceModel model(still_device());
  int frames = 0;
  InfraredParser parser([&](const RawFrame&) { ++frames; });
  emulator::InfraredSource source(model);
  for (int i = 0; i < 3; ++i) {
    int empty = 0;
    source.send_frame({}, [&](usb::Status status, std::span<const std::byte> data) {
      empty = data.empty() ? empty + 1 : 0;
      parser.push(empty == 10 || empty == 17 ? usb::Status::error : status, data, {});
      return true;
    });
  }
  EXPECT_EQ(frames, 3);
  EXPECT_EQ(parser.counters().lost_images, 0u);
}

TEST(InfraredParser, ADeviceStuckAtOneNumberIsHeardAllTheSame) {
  emulator::DeviceModel model(still_device());
  model.faults().inject(Fault::sequence_repeat, 1000);
  int frames = 0;
  InfraredParser parser([&](const RawFrame&) { ++frames; });
  emulator::InfraredSource source(model);
  for (int i = 0; i < 5; ++i)
    source.send_frame({}, [&](usb::Status status, std::span<const std::byte> data) {
      parser.push(status, data, {});
      return true;
    });
  EXPECT_EQ(frames, 5);
}

TEST(InfraredParser, CountsFramesOfWhichNothingCame) {
  emulator::DeviceModel model(still_device());
  InfraredParser parser([](const RawFrame&) {});
  emulator::InfraredSource source(model);
  for (int i = 0; i < 6; ++i)
    source.send_frame({}, [&](usb::Status status, std::span<const std::byte> data) {
      if (i != 2 && i != 3) parser.push(status, data, {});
      return true;
    });
  EXPECT_EQ(parser.counters().frames, 4u);
  EXPECT_EQ(parser.counters().lost_frames, 2u);
}

TEST(InfraredParser, APacketLargerThanAnyIsDropped) {
  InfraredParser parser([](const RawFrame&) { FAIL(); });
  const std::vector<std::byte> large(kSubImageBytes + 1);
  for (int i = 0; i < 3; ++i) parser.push(usb::Status::completed, large, {});
  for (int i = 0; i < 4; ++i) parser.push(usb::Status::completed, {}, {});
  EXPECT_EQ(parser.counters().lost_images, 1u);
}

// ---- Colour

struct ColourCost {
  Fault fault;
  const char* name;
  std::uint64_t frames, broken;
};

class ColourFault : public testing::TestWithParam<ColourCost> {};

TEST_P(ColourFault, CostsTheMessageConcernedAndNothingElse) {
  emulator::DeviceModel model(still_device());
  emulator::ColourSource source(model);
  std::uint32_t last = 0;
  ColourParser parser([&](const ColourFrame& frame) {
    EXPECT_GT(frame.jpeg.size(), 1000u);
    EXPECT_TRUE(is_expected_jpeg(frame.jpeg));
    last = frame.sequence;
  });
  model.faults().inject(GetParam().fault, 1, 2);
  for (int i = 0; i < 6; ++i)
    source.send_message({}, kColourTransferBytes, [&](usb::Status status, std::span<const std::byte> data) {
      parser.push(status, data, {});
      return true;
    });
  EXPECT_EQ(parser.frames(), GetParam().frames);
  EXPECT_EQ(parser.broken(), GetParam().broken);
  EXPECT_EQ(last, 5u);
}

INSTANTIATE_TEST_SUITE_P(Stream, ColourFault,
                         testing::Values(ColourCost{Fault::colour_without_end, "NoEndOfPicture", 5, 1},
                                         ColourCost{Fault::colour_wrong_size, "AWrongSize", 5, 1},
                                         ColourCost{Fault::colour_filler_too_long, "MoreFillerThanMessage", 5, 1},
                                         ColourCost{Fault::colour_too_long, "MoreThanTwoMebibytes", 5, 1},
                                         ColourCost{Fault::colour_huge_picture, "AHugePicture", 5, 1},
                                         // Well framed, and its header is right: a decoder has to find out.
                                         ColourCost{Fault::colour_truncated_scan, "ATruncatedScan", 6, 0}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(ColourParser, AStreamThatBeginsInTheMiddleOfAMessageIsNobodysFault) {
  emulator::DeviceModel model(still_device());
  emulator::ColourSource source(model);
  ColourParser parser([](const ColourFrame&) {});
  int pieces = 0;
  for (int i = 0; i < 3; ++i)
    source.send_message({}, kColourTransferBytes, [&](usb::Status status, std::span<const std::byte> data) {
      if (pieces++ > 0) parser.push(status, data, {});
      return true;
    });
  EXPECT_EQ(parser.frames(), 2u);
  EXPECT_EQ(parser.broken(), 0u);
}

TEST(ColourParser, AMessageThatFillsItsLastTransferIsWhole) {
  emulator::DeviceModel model(still_device());
  emulator::ColourSource source(model);
  ColourParser parser([](const ColourFrame&) {});
  std::vector<std::byte> message;
  source.send_message({}, 1u << 21, [&](usb::Status, std::span<const std::byte> data) {
    message.assign(data.begin(), data.end());
    return true;
  });
  // Filler until it is a multiple of the transfers.
  const std::size_t more = (kColourTransferBytes - message.size() % kColourTransferBytes) % kColourTransferBytes;
  message.insert(message.end() - 56, more, std::byte{'Z'});
  write_u32(message, message.size() - 56 + 8, static_cast<std::uint32_t>(64 + more));
  write_u32(message, message.size() - 56 + 36, static_cast<std::uint32_t>(message.size()));
  for (int i = 0; i < 2; ++i) {
    for (std::size_t at = 0; at < message.size(); at += kColourTransferBytes)
      parser.push(usb::Status::completed, std::span<const std::byte>(message).subspan(at, kColourTransferBytes), {});
    parser.push(usb::Status::completed, {}, {});
  }
  EXPECT_EQ(parser.frames(), 2u);
  EXPECT_EQ(parser.broken(), 0u);
}

}  // namespace
}  // namespace booth::drivers::kinect2
