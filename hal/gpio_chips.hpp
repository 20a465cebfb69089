// What a machine has in the way of GPIO chips and lines, as plain values, so that it can be examined without touching a line.
#pragma once

#include <string>
#include <vector>

namespace booth::hal {

struct GpioLineInfo {
  unsigned offset = 0;
  std::string name;      ///< empty where nobody named it
  std::string consumer;  ///< who uses it; may be empty although it is used
  bool used = false, output = false;
};

struct GpioChipInfo {
  std::string path, name, label;    ///< "/dev/gpiochip0", "gpiochip0", "pinctrl-..."; the last two are empty where the chip cannot be opened
  std::string problem;              ///< why it cannot be opened
  std::vector<GpioLineInfo> lines;  ///< by offset
};
using GpioChips = std::vector<GpioChipInfo>;

}  // namespace booth::hal
