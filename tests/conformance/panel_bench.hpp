// A GPIO chip on a test bench, real to the kernel or simulated in the process: its wires can be pulled, its lamps looked at, its plug drawn.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "drivers/gpio/chip.hpp"
#include "hal/clock.hpp"

namespace booth::tests {

enum class BenchKind { simulated, gpio_sim };  ///< gpio_sim: the kernel's gpio-sim behind libgpiod

/// A chip with the lines "start", "stop", "emergency", "light" and "buzzer" at offsets 0 to 4.
class PanelBench {
 public:
  virtual ~PanelBench() = default;
  virtual std::unique_ptr<drivers::gpio::ChipSource> chips() = 0;
  virtual std::string chip() const = 0;  ///< its label
  /// The voltage that the world outside puts on a line; kept while the chip is unplugged.
  virtual void drive(const std::string& line, bool high) = 0;
  /// The voltage that the daemon puts on a line; false while nobody drives it.
  virtual bool high(const std::string& line) = 0;
  virtual void unplug() = 0;
  virtual void plug_in() = 0;
  /// Another program takes a line, and gives it back.
  virtual void occupy(const std::string& line) = 0;
  virtual void leave() = 0;
};

/// Why there is no such bench on this machine; empty where there is one.
std::string why_no_bench(BenchKind kind);
/// Throws std::runtime_error when the kernel refuses.
std::unique_ptr<PanelBench> make_bench(BenchKind kind, const hal::Clock& clock);
const char* name_of(BenchKind kind);

}  // namespace booth::tests
