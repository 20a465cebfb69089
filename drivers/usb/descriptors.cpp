// A walk over length-prefixed records that believes none of the lengths.
#include "drivers/usb/descriptors.hpp"

#include <algorithm>

namespace booth::drivers::usb {
namespace {

constexpr int kConfiguration = 2, kInterface = 4, kEndpoint = 5, kCompanion = 48;
constexpr int kIsochronous = 1, kInterrupt = 3;
/// More settings than any device has; a device that claims more is lying.
constexpr std::size_t kMostSettings = 1024;

int byte_at(std::span<const std::byte> record, std::size_t i) { return i < record.size() ? std::to_integer<int>(record[i]) : 0; }
int word_at(std::span<const std::byte> record, std::size_t i) { return byte_at(record, i) | byte_at(record, i + 1) << 8; }

/// Seconds between two services of a periodic endpoint; 0 when its interval makes no sense.
double interval_seconds(int type, int interval, hal::UsbSpeed speed) {
  if (interval < 1) return 0;
  const bool micro = speed >= hal::UsbSpeed::high_480;
  if (!micro && type == kInterrupt) return interval * 1e-3;
  return static_cast<double>(1u << (std::min(interval, 16) - 1)) * (micro ? 125e-6 : 1e-3);
}

struct Endpoint {
  double seconds = 0;
  double bytes = 0;
};

Endpoint endpoint_of(std::span<const std::byte> record, hal::UsbSpeed speed) {
  const int type = byte_at(record, 3) & 3;
  if (type != kIsochronous && type != kInterrupt) return {};
  const int packet = word_at(record, 4);
  const int per_interval = (packet & 0x7FF) * (speed == hal::UsbSpeed::high_480 ? 1 + ((packet >> 11) & 3) : 1);
  return {interval_seconds(type, byte_at(record, 6), speed), static_cast<double>(per_interval)};
}

}  // namespace

std::vector<AlternateSetting> alternate_settings(std::span<const std::byte> bytes, hal::UsbSpeed speed) {
  std::vector<AlternateSetting> out;
  int configuration = 0;
  Endpoint last;
  bool open = false;
  const auto settle = [&] {
    if (open && last.seconds > 0) out.back().reserved += last.bytes / last.seconds;
    last = {};
  };
  while (bytes.size() >= 2) {
    const auto length = static_cast<std::size_t>(byte_at(bytes, 0));
    if (length < 2 || length > bytes.size()) break;
    const auto record = bytes.first(length);
    bytes = bytes.subspan(length);
    switch (byte_at(record, 1)) {
      case kConfiguration:
        settle();
        open = false;
        configuration = byte_at(record, 5);
        break;
      case kInterface:
        settle();
        if (length < 9 || out.size() == kMostSettings) return out;
        out.push_back({configuration, byte_at(record, 2), byte_at(record, 3)});
        open = true;
        break;
      case kEndpoint:
        settle();
        if (open && length >= 7) last = endpoint_of(record, speed);
        break;
      case kCompanion:
        // The companion knows the whole interval, bursts and all; it belongs to the endpoint right before it.
        if (last.seconds > 0 && length >= 6) last.bytes = word_at(record, 4);
        break;
      default:
        break;
    }
  }
  settle();
  return out;
}

}  // namespace booth::drivers::usb
