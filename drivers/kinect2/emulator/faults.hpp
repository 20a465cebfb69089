// What can go wrong with a sensor, to be switched on from outside while it runs.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>

namespace booth::drivers::kinect2::emulator {

enum class Fault : std::uint8_t {
  // Infrared packets; one occurrence is one packet or image.
  packet_lost,        ///< it never was
  packet_error,       ///< its status is an error
  packet_truncated,   ///< 1000 bytes short
  last_packet_lost,   ///< of an image
  empty_packets,      ///< three more empty ones inside an image
  footer_length,      ///< wrong length in a footer
  footer_index_ten,   ///< the first index beyond the last
  footer_index_31,    ///< the last that a shift of 32 bits allows
  footer_index_32,    ///< the first that it does not
  footer_index_huge,  ///< 0xFFFFFFFF
  image_missing,      ///< one image of a frame is not sent
  sequence_jump,      ///< the frame counter jumps by a million
  sequence_repeat,    ///< two frames with one number
  sequence_wraps,     ///< the frame counter stands two before its wrap
  time_jump,          ///< the time stamp jumps by an hour
  time_wraps,         ///< the time stamp stands a tenth of a second before its wrap
  stream_stalls,      ///< no more packets until the stream is opened anew
  // Colour; one occurrence is one message.
  colour_without_end,      ///< the JPEG's end marker is missing
  colour_wrong_size,       ///< the trailer's total size is off by one
  colour_filler_too_long,  ///< more filler than message
  colour_too_long,         ///< more than two mebibytes
  colour_huge_picture,     ///< a JPEG that claims 65535 x 65535
  colour_truncated_scan,   ///< a JPEG whose picture data stop in the middle
  // Commands; one occurrence is one command.
  command_timeout,
  late_completion,      ///< its answer comes when the next command was sent
  reply_is_completion,  ///< 16 bytes of data that begin like a completion
  wrong_transaction,
  premature_completion,
  short_data,
  refused,
  // Calibration and state; one occurrence is one answer.
  short_phase_tables,
  nan_intrinsics,
  zero_intrinsics,
  huge_intrinsics,
  serial_without_terminator,
  serial_with_control_characters,
  never_ready,
  alternate_refused,   ///< no bandwidth
  unplug_on_request,   ///< leaves the bus at a command or control request
  vanish_after_close,  ///< away for five seconds
  count_
};

/// Thread-safe. A fault happens `times` times, after it was let pass `after` times.
class FaultPlan {
 public:
  void inject(Fault fault, int times = 1, int after = 0) {
    const std::lock_guard lock(mutex_);
    plan_.at(static_cast<std::size_t>(fault)) = {times, after};
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    plan_ = {};
  }
  /// Whether this opportunity is one at which the fault happens.
  bool take(Fault fault) {
    const std::lock_guard lock(mutex_);
    auto& p = plan_.at(static_cast<std::size_t>(fault));
    if (p.times == 0) return false;
    if (p.after > 0) return --p.after, false;
    --p.times;
    return true;
  }

 private:
  struct Plan {
    int times = 0, after = 0;
  };
  std::mutex mutex_;
  std::array<Plan, static_cast<std::size_t>(Fault::count_)> plan_{};
};

}  // namespace booth::drivers::kinect2::emulator
