// The narrow view of GPIO that the panel needs, so that libgpiod and a simulated chip can stand behind it alike.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/time.hpp"

namespace booth::drivers::gpio {

enum class Bias : std::uint8_t { as_is, disabled, pull_up, pull_down };

/// Which line, and how it is wired. `line` is a name as the chip (or its device tree) gives it, or an offset in digits; a name goes first.
struct LineRequest {
  std::string line;
  bool output = false, active_low = false;
  Bias bias = Bias::as_is;  ///< of inputs
};

/// Why a request was refused. `gone`: the chip is not there any more, and nothing of it is of use.
enum class Fault : std::uint8_t { no_chip, no_line, busy, access, unsupported, gone, io };

/// Names the chip, the line and the remedy.
class Error : public std::runtime_error {
 public:
  Error(Fault fault, const std::string& sentence) : std::runtime_error(sentence), fault_(fault) {}
  Fault fault() const { return fault_; }

 private:
  Fault fault_;
};

/// `active` is the level after the edge with active-low taken into account; two edges in a row may say the same where one was too short to be read.
struct Edge {
  int slot = 0;
  bool active = false;
  hal::MonotonicTime at{};  ///< when the kernel saw it
};

inline constexpr int kSlots = 8;  ///< lines that a chip lends at once, known by the caller's numbers

/// An open chip; closing releases its lines. All but wake() belong to one thread. Everything that may throw throws Error.
class Chip {
 public:
  virtual ~Chip() = default;
  /// Lends a line; an output begins inactive. Other lines are not disturbed when this throws.
  virtual void request(int slot, const LineRequest& request) = 0;
  /// Harmless when the slot is empty.
  virtual void release(int slot) noexcept = 0;
  virtual bool level(int slot) = 0;
  virtual void set(int slot, bool active) = 0;
  /// Waits until there is an edge, wake() or the end of `timeout`; appends what there is, in the order of time. A chip remembers some 16 edges of a line
  /// that nobody reads, and loses further ones.
  virtual void wait(hal::Nanoseconds timeout, std::vector<Edge>& out) = 0;
  /// Ends a wait(), this one or the next. Thread-safe.
  virtual void wake() noexcept = 0;
};

class ChipSource {
 public:
  virtual ~ChipSource() = default;
  /// By label, name or path.
  virtual std::unique_ptr<Chip> open(const std::string& chip) = 0;
};

}  // namespace booth::drivers::gpio
