// What the driver wants a person to know, without knowing where the daemon writes it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace booth::drivers::kinect2 {

enum class Gravity : std::uint8_t { info, warning };

/// One sentence that names the device. Called by any thread that works with a device; the same sentence may come again and again, its receiver counts.
using Notes = std::function<void(Gravity gravity, const std::string& sentence)>;

inline void note(const Notes& notes, Gravity gravity, const std::string& sentence) {
  if (notes) notes(gravity, sentence);
}

}  // namespace booth::drivers::kinect2
