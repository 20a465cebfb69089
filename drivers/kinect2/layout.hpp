// The numbers of the Kinect v2 that more than one part of its driver needs (docs/reference/kinect2.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

namespace booth::drivers::kinect2 {

inline constexpr std::pair<std::uint16_t, std::uint16_t> kDeviceIds[]{{0x045E, 0x02C4}, {0x045E, 0x02D8}};

inline constexpr int kWidth = 512, kHeight = 424;
inline constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

// One frame is ten packed images; one image on the wire is followed by a footer.
inline constexpr int kImages = 10;
inline constexpr std::size_t kRowBytes = 704;                    ///< 512 codes of 11 bits
inline constexpr std::size_t kImageBytes = kRowBytes * kHeight;  ///< 298,496
inline constexpr std::size_t kFooterBytes = 152;
inline constexpr std::size_t kSubImageBytes = kImageBytes + kFooterBytes;
inline constexpr std::size_t kFrameBytes = kImages * kImageBytes;  ///< ten images without their footers, index 0 first
inline constexpr unsigned kNeededImages = 0x1FF;                   ///< image 9 (emitter off) is not used

inline constexpr std::size_t kPacketBytes = 33'792;  ///< of one 125 us service interval
inline constexpr int kPacketsPerTransfer = 8;

inline constexpr std::uint8_t kCommandOut = 0x02, kReplyIn = 0x81, kColourIn = 0x83, kInfraredIn = 0x84;
inline constexpr int kControlInterface = 0, kStreamInterface = 1;

inline constexpr std::size_t kColourTransferBytes = 16'384, kColourMessageBytes = std::size_t{2} << 20;

/// Device ticks of time stamps per second (0.125 ms each).
inline constexpr std::uint32_t kTicksPerSecond = 8'000;

// Commands (32-bit codes of the command packet).
enum class Command : std::uint32_t {
  reboot = 0x00,
  versions = 0x02,
  start_infrared = 0x09,
  stop_infrared = 0x0A,
  hardware_info = 0x14,
  read_parameter = 0x16,
  read_page = 0x22,
  colour_streaming = 0x2B,
  colour_setting = 0x3E,
  light = 0x4B,
};
inline constexpr std::uint32_t kRequestMagic = 0x0602'2009, kCompletionMagic = 0x0A6F'E000;
inline constexpr std::size_t kRequestHeaderBytes = 20, kCompletionBytes = 16;
inline constexpr std::uint32_t kStatusParameter = 0x0009'0000;

// Pages of `read_page`.
enum class Page : std::uint32_t { serial = 1, phase_offsets = 2, depth_camera = 3, colour_camera = 4 };
inline constexpr std::size_t kPhaseTablesBytes = 1'302'572, kDepthCameraBytes = 92, kColourCameraBytes = 12'981, kHardwareBytes = 92;

}  // namespace booth::drivers::kinect2
