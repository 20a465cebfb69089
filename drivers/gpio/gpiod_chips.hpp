// Real GPIO chips through libgpiod.
#pragma once

#include <memory>

#include "drivers/gpio/chip.hpp"
#include "hal/gpio_chips.hpp"

namespace booth::drivers::gpio {

/// The chips under /dev of this machine. Thread-safe.
std::unique_ptr<ChipSource> make_gpiod_chips();

/// Every chip and line, without requesting any. Never throws for what it finds.
hal::GpioChips list_gpiod_chips();

}  // namespace booth::drivers::gpio
