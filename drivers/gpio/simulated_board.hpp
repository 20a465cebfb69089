// A GPIO chip that exists only in the process: a test, or a person at a keyboard, presses its buttons and looks at its lamps.
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/gpio/chip.hpp"
#include "hal/clock.hpp"

namespace booth::drivers::gpio {

/// The chip and what is wired to it. Thread-safe. It behaves as a kernel's chip does, its short memory for edges included.
class SimulatedBoard {
 public:
  struct Change {
    hal::MonotonicTime at{};
    bool active = false;
  };

  /// Lines by name, at offsets in this order. `clock` must outlive it.
  SimulatedBoard(const hal::Clock& clock, std::string label, const std::vector<std::string>& lines);

  /// What is wired to the line puts this voltage on it; nothing: the line floats, and its bias decides.
  void drive(const std::string& line, std::optional<bool> high);
  /// The same for a button: drives the line to the level that whoever requested it takes as active, or lets go.
  void press(const std::string& line, bool pressed);
  /// What the daemon drives; false while the line is not requested as an output.
  bool lit(const std::string& line) const;
  /// The voltage that the daemon puts on the line; false while it is not requested as an output.
  bool high(const std::string& line) const;
  /// Changes of an output, oldest first, the last 4096 of them.
  std::vector<Change> history(const std::string& line) const;
  bool requested(const std::string& line) const;

  void unplug();
  void plug_in();
  /// Somebody else takes the line, which must be free.
  void occupy(const std::string& line, const std::string& consumer);
  void leave(const std::string& line);

 private:
  friend class SimulatedChip;
  friend class SimulatedChips;
  struct Line {
    std::string name, consumer;
    bool requested = false;
    LineRequest request;
    std::optional<bool> driven;
    bool pressed = false;
    bool active = false;  ///< of an output: what was set; of an input: the level at the last edge
    std::deque<Change> edges, history;
  };
  Line& line_by_name(const std::string& name);
  const Line& line_by_name(const std::string& name) const;
  static bool input_level(const Line& line);
  void moved(Line& line);

  const hal::Clock& clock_;
  const std::string label_;
  mutable std::mutex mutex_;
  std::condition_variable bell_;
  std::vector<Line> lines_;
  bool plugged_ = true;
  std::uint64_t generation_ = 0;  ///< a chip opened before the last unplugging is of no use
};

/// `board` must outlive the source and its chips.
std::unique_ptr<ChipSource> make_simulated_chips(SimulatedBoard& board);

}  // namespace booth::drivers::gpio
