// How long the driver waits for a sensor in each situation; tests shorten it.
#pragma once

#include "hal/time.hpp"

namespace booth::drivers::kinect2 {

struct Patience {
  hal::Nanoseconds control = std::chrono::seconds(1);            ///< one control request
  hal::Nanoseconds open_again = std::chrono::milliseconds(100);  ///< between attempts to open, ten of them
  hal::Nanoseconds ready = std::chrono::seconds(5);              ///< for the status word to say that it may stream
  hal::Nanoseconds ready_poll = std::chrono::milliseconds(100);
  hal::Nanoseconds cancel = std::chrono::seconds(3);      ///< for transfers to call back after they were cancelled
  hal::Nanoseconds renumbered = std::chrono::seconds(1);  ///< after a bus reset from which it came back as another device
  /// Without a complete frame; shorter than the two seconds after which a reader gives up by itself, so that the ladder learns of each stall.
  hal::Nanoseconds stall = std::chrono::milliseconds(1800);
  hal::Nanoseconds absence = std::chrono::seconds(10);  ///< a rebooting device is away for about three seconds, some for ten
};

}  // namespace booth::drivers::kinect2
