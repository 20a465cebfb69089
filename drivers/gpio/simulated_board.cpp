// One mutex, one bell: levels and edges in memory, refused and lost in the same places as the kernel's.
#include "drivers/gpio/simulated_board.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace booth::drivers::gpio {
namespace {

constexpr std::size_t kKernelMemory = 16;  ///< edges that the kernel keeps for each line (drivers/gpio/gpiolib-cdev.c of 6.1)
constexpr std::size_t kHistory = 4096;

}  // namespace

class SimulatedChip final : public Chip {
 public:
  SimulatedChip(SimulatedBoard& board, std::uint64_t generation) : board_(board), generation_(generation) { slots_.fill(-1); }
  ~SimulatedChip() override {
    for (int i = 0; i < kSlots; ++i) release(i);
  }
  SimulatedChip(const SimulatedChip&) = delete;

  void request(int slot, const LineRequest& request) override {
    release(slot);
    const std::lock_guard lock(board_.mutex_);
    check();
    const int found = find(request.line);
    auto& line = board_.lines_[static_cast<std::size_t>(found)];
    if (!line.consumer.empty()) throw Error(Fault::busy, where(request.line) + " is used by \"" + line.consumer + "\"; free it, or name another line");
    line.requested = true;
    line.request = request;
    line.consumer = "boothd";
    line.edges.clear();
    line.active = request.output ? false : SimulatedBoard::input_level(line);
    slots_[static_cast<std::size_t>(slot)] = found;
  }
  void release(int slot) noexcept override {
    int& index = slots_[static_cast<std::size_t>(slot)];
    const std::lock_guard lock(board_.mutex_);
    if (index >= 0 && board_.generation_ == generation_) {
      auto& line = board_.lines_[static_cast<std::size_t>(index)];
      line.requested = false;
      line.consumer.clear();
    }
    index = -1;
  }
  bool level(int slot) override {
    const std::lock_guard lock(board_.mutex_);
    check();
    return SimulatedBoard::input_level(line(slot));
  }
  void set(int slot, bool active) override {
    const std::lock_guard lock(board_.mutex_);
    check();
    auto& l = line(slot);
    if (l.active == active) return;
    l.active = active;
    l.history.push_back({board_.clock_.now(), active});
    if (l.history.size() > kHistory) l.history.pop_front();
  }
  void wait(hal::Nanoseconds timeout, std::vector<Edge>& out) override {
    std::unique_lock lock(board_.mutex_);
    const auto first = static_cast<std::ptrdiff_t>(out.size());
    board_.bell_.wait_for(lock, timeout, [&] {
      if (rung_ || board_.generation_ != generation_) return true;
      for (const int i : slots_)
        if (i >= 0 && !board_.lines_[static_cast<std::size_t>(i)].edges.empty()) return true;
      return false;
    });
    rung_ = false;
    check();
    for (int slot = 0; slot < kSlots; ++slot) {
      if (slots_[static_cast<std::size_t>(slot)] < 0) continue;
      for (const auto& e : line(slot).edges) out.push_back({slot, e.active, e.at});
      line(slot).edges.clear();
    }
    std::stable_sort(out.begin() + first, out.end(), [](const Edge& a, const Edge& b) { return a.at < b.at; });
  }
  void wake() noexcept override {
    const std::lock_guard lock(board_.mutex_);
    rung_ = true;
    board_.bell_.notify_all();
  }

 private:
  std::string where(const std::string& line) const { return "line \"" + line + "\" of chip \"" + board_.label_ + "\""; }
  void check() const {
    if (board_.generation_ != generation_) throw Error(Fault::gone, "chip \"" + board_.label_ + "\" is gone; plug it in again");
  }
  SimulatedBoard::Line& line(int slot) { return board_.lines_[static_cast<std::size_t>(slots_[static_cast<std::size_t>(slot)])]; }
  int find(const std::string& wanted) const {
    const auto by_name = std::find_if(board_.lines_.begin(), board_.lines_.end(), [&](const auto& l) { return l.name == wanted; });
    if (by_name != board_.lines_.end()) return static_cast<int>(by_name - board_.lines_.begin());
    int offset = -1;
    const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), offset);
    if (error == std::errc() && end == wanted.data() + wanted.size() && offset >= 0 && offset < static_cast<int>(board_.lines_.size())) return offset;
    throw Error(Fault::no_line, where(wanted) + " does not exist; `boothctl doctor` lists them");
  }

  SimulatedBoard& board_;
  const std::uint64_t generation_;
  std::array<int, kSlots> slots_{};
  bool rung_ = false;
};

class SimulatedChips final : public ChipSource {
 public:
  explicit SimulatedChips(SimulatedBoard& board) : board_(board) {}
  std::unique_ptr<Chip> open(const std::string& chip) override {
    const std::lock_guard lock(board_.mutex_);
    if (!board_.plugged_ || chip != board_.label_) throw Error(Fault::no_chip, "gpio.chip \"" + chip + "\" is not there; plug it in");
    return std::make_unique<SimulatedChip>(board_, board_.generation_);
  }

 private:
  SimulatedBoard& board_;
};

SimulatedBoard::SimulatedBoard(const hal::Clock& clock, std::string label, const std::vector<std::string>& lines) : clock_(clock), label_(std::move(label)) {
  for (const auto& name : lines) lines_.emplace_back().name = name;
}

SimulatedBoard::Line& SimulatedBoard::line_by_name(const std::string& name) {
  for (auto& line : lines_)
    if (line.name == name) return line;
  throw std::invalid_argument("the simulated board has no line \"" + name + "\"");
}
const SimulatedBoard::Line& SimulatedBoard::line_by_name(const std::string& name) const { return const_cast<SimulatedBoard*>(this)->line_by_name(name); }

bool SimulatedBoard::input_level(const Line& line) {
  // Without a bias of the chip's the board has a resistor of its own, to the level at rest.
  const bool floating = line.request.bias == Bias::pull_up || (line.request.bias != Bias::pull_down && line.request.active_low);
  const bool high = line.driven.value_or(floating);
  return line.pressed || high != line.request.active_low;
}

void SimulatedBoard::moved(Line& line) {
  if (!line.requested || line.request.output) return;
  const bool active = input_level(line);
  if (active == line.active) return;
  line.active = active;
  if (line.edges.size() < kKernelMemory) line.edges.push_back({clock_.now(), active});
  bell_.notify_all();
}

void SimulatedBoard::drive(const std::string& name, std::optional<bool> high) {
  const std::lock_guard lock(mutex_);
  Line& line = line_by_name(name);
  line.driven = high;
  moved(line);
}

void SimulatedBoard::press(const std::string& name, bool pressed) {
  const std::lock_guard lock(mutex_);
  Line& line = line_by_name(name);
  line.pressed = pressed;
  moved(line);
}

bool SimulatedBoard::lit(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const Line& line = line_by_name(name);
  return line.requested && line.request.output && line.active;
}

bool SimulatedBoard::high(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const Line& line = line_by_name(name);
  return line.requested && line.request.output && line.active != line.request.active_low;
}

std::vector<SimulatedBoard::Change> SimulatedBoard::history(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const Line& line = line_by_name(name);
  return {line.history.begin(), line.history.end()};
}

bool SimulatedBoard::requested(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  return line_by_name(name).requested;
}

void SimulatedBoard::unplug() {
  const std::lock_guard lock(mutex_);
  plugged_ = false;
  ++generation_;
  for (auto& line : lines_) {
    line.requested = false;
    line.consumer.clear();
    line.edges.clear();
    line.active = false;
  }
  bell_.notify_all();
}

void SimulatedBoard::plug_in() {
  const std::lock_guard lock(mutex_);
  plugged_ = true;
}

void SimulatedBoard::occupy(const std::string& name, const std::string& consumer) {
  const std::lock_guard lock(mutex_);
  Line& line = line_by_name(name);
  if (!line.consumer.empty()) throw std::logic_error("line \"" + name + "\" is taken already");
  line.consumer = consumer;
}

void SimulatedBoard::leave(const std::string& name) {
  const std::lock_guard lock(mutex_);
  Line& line = line_by_name(name);
  if (!line.requested) line.consumer.clear();
}

std::unique_ptr<ChipSource> make_simulated_chips(SimulatedBoard& board) { return std::make_unique<SimulatedChips>(board); }

}  // namespace booth::drivers::gpio
