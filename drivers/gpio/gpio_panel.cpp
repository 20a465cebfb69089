// One loop: get what is missing, look at what is there, light what should be lit, sleep until something is due.
#include "drivers/gpio/gpio_panel.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>

#include "drivers/gpio/rhythm.hpp"

namespace booth::drivers::gpio {
namespace {

using namespace std::chrono_literals;

constexpr hal::Nanoseconds kLook = 250ms;  ///< how often levels are compared with what edges said; finds a chip that went without a word, too
constexpr hal::Nanoseconds kCalm = 5s;     ///< a line that has worked for so long starts again with the shortest wait for a retry
constexpr std::size_t kEvents = 64;

/// When to try again: twice as late each time, up to a limit.
class Retry {
 public:
  bool due(hal::MonotonicTime now) const { return now >= at_; }
  hal::MonotonicTime at() const { return at_; }
  void failed(hal::MonotonicTime now, const PanelSettings& settings) {
    pause_ = std::clamp(2 * pause_, settings.first_retry, settings.last_retry);
    at_ = now + pause_;
  }
  void succeeded() {
    pause_ = 0ns;
    at_ = {};
  }

 private:
  hal::Nanoseconds pause_{0};
  hal::MonotonicTime at_{};
};

bool is_output(Role role) { return role == Role::light || role == Role::buzzer; }

const char* name_of(Role role) {
  switch (role) {
    case Role::start:
    case Role::toggle:
      return "start button";
    case Role::stop:
      return "stop button";
    case Role::emergency_stop:
      return "emergency stop";
    case Role::light:
      return "light";
    case Role::buzzer:
      return "buzzer";
  }
  return "?";
}

class GpioPanel final : public hal::Panel {
 public:
  GpioPanel(std::unique_ptr<ChipSource> chips, PanelSettings settings, const hal::Clock& clock)
      : chips_(std::move(chips)), settings_(std::move(settings)), clock_(clock) {
    if (settings_.lines.size() > kSlots) throw std::invalid_argument("a panel has at most 8 lines");
    for (const auto& line : settings_.lines) {
      const bool button = line.role != Role::emergency_stop;
      lines_.emplace_back(line, Button({settings_.debounce, button ? settings_.stuck : 0ns, settings_.edges_per_second}));
      // Nobody knows yet: not readable is pressed, and reading it will release it.
    }
    shown_since_ = clock_.now();
    thread_ = std::thread([this] { work(); });
  }
  ~GpioPanel() override {
    stop_ = true;
    wake();
    thread_.join();
  }
  GpioPanel(const GpioPanel&) = delete;

  std::optional<hal::TriggerEvent> wait(hal::Nanoseconds timeout) override {
    std::unique_lock lock(mutex_);
    if (!heard_.wait_for(lock, timeout, [&] { return !events_.empty(); })) return std::nullopt;
    const hal::TriggerEvent out = events_.front();
    events_.pop_front();
    return out;
  }

  void show(const hal::LightShow& show) override {
    {
      const std::lock_guard lock(mutex_);
      if (show == shown_) return;
      shown_ = show;
      shown_since_ = clock_.now();
    }
    wake();
  }

  void play(hal::Sound sound) override {
    {
      const std::lock_guard lock(mutex_);
      sound_ = sound;
      sound_since_ = clock_.now();
    }
    wake();
  }

  std::vector<std::string> problems() const override {
    const std::lock_guard lock(mutex_);
    return problems_;
  }
  std::uint64_t progress() const override { return progress_.load(std::memory_order_relaxed); }

 private:
  struct Line {
    Line(PanelSettings::Line l, Button b) : role(l.role), request(std::move(l.request)), button(b) {}
    Role role;
    LineRequest request;
    Button button;
    bool open = false, lit = false;
    bool undecided = false;  ///< pressed, and it is not known yet how long
    hal::MonotonicTime opened{}, pressed{};
    Retry retry;
    std::string problem;
  };

  void work() {
    while (!stop_) {
      progress_.fetch_add(1, std::memory_order_relaxed);
      const hal::MonotonicTime now = clock_.now();
      try {
        if (!chip_ && chip_retry_.due(now)) open_chip(now);
        if (chip_) {
          open_lines(now);
          look(now);
          light();
        }
      } catch (const Error& e) {
        lose_chip(e.what(), clock_.now());
      }
      watch_emergency_stop();
      tell();
      sleep();
    }
    // The light must not go on burning for a daemon that is not there.
    try {
      for (int i = 0; chip_ && i < count(); ++i)
        if (is_output(line(i).role) && line(i).open) chip_->set(i, false);
    } catch (const Error&) {
    }
    const std::lock_guard lock(chip_mutex_);
    chip_.reset();
  }

  int count() const { return static_cast<int>(lines_.size()); }
  Line& line(int i) { return lines_[static_cast<std::size_t>(i)]; }

  void open_chip(hal::MonotonicTime now) {
    auto opened = chips_->open(settings_.chip);
    chip_problem_.clear();
    chip_opened_ = now;
    for (auto& l : lines_) l.retry.succeeded();
    const std::lock_guard lock(chip_mutex_);
    chip_ = std::move(opened);
  }

  void lose_chip(const std::string& why, hal::MonotonicTime now) {
    chip_problem_ = why;
    for (int i = 0; i < count(); ++i) {
      line(i).open = line(i).undecided = false;
      line(i).problem.clear();
    }
    {
      const std::lock_guard lock(chip_mutex_);
      chip_.reset();
    }
    if (now - chip_opened_ > kCalm) chip_retry_.succeeded();
    chip_retry_.failed(now, settings_);
  }

  /// Errors that concern one line leave the others alone; a chip that is gone is gone for all.
  template <class F>
  void with_line(int i, F work) {
    try {
      work();
    } catch (const Error& e) {
      if (e.fault() == Fault::gone || e.fault() == Fault::no_chip) throw;
      lose_line(i, e.what());
    }
  }

  void lose_line(int i, const std::string& why) {
    Line& l = line(i);
    chip_->release(i);
    const hal::MonotonicTime now = clock_.now();
    if (l.open && now - l.opened > kCalm) l.retry.succeeded();
    l.open = l.undecided = false;
    l.problem = why;
    l.retry.failed(now, settings_);
  }

  void open_lines(hal::MonotonicTime now) {
    for (int i = 0; i < count(); ++i) {
      Line& l = line(i);
      if (l.open || !l.retry.due(now)) continue;
      with_line(i, [&] {
        chip_->request(i, l.request);
        l.lit = l.undecided = false;
        // Pressed already when first seen: no press, and an emergency stop is found pressed by watch_emergency_stop().
        if (!is_output(l.role)) l.button.begin(chip_->level(i), clock_.now());
        l.open = true;
        l.opened = now;
        l.problem.clear();
        last_look_ = now;
      });
    }
  }

  /// Ticks, lost edges, lost chips, buttons that are not let go.
  void look(hal::MonotonicTime now) {
    const bool all = now - last_look_ >= kLook;
    if (all) last_look_ = now;
    for (int i = 0; i < count(); ++i) {
      Line& l = line(i);
      if (!l.open || is_output(l.role)) continue;
      with_line(i, [&] {
        // A level that differs from the last edge's is an edge that nobody was told of.
        if ((all || l.button.next() <= now) && chip_->level(i) != l.button.last_level()) take({i, !l.button.last_level(), clock_.now()});
        if (l.open)
          if (const auto change = l.button.tick(now)) happened(l, *change);
        // A line that is at rest again has an edge on its way, which decides.
        if (l.open && l.undecided && !l.button.moving() && now >= long_at(l) && chip_->level(i)) decide(l, long_at(l));
        if (l.open) l.problem = l.button.stuck(now) ? stuck_sentence(l) : "";
      });
    }
    if (all)  // an output notices only by being set that its chip is gone
      for (int i = 0; i < count(); ++i)
        if (line(i).open && is_output(line(i).role)) with_line(i, [&] { chip_->set(i, line(i).lit); });
  }

  std::string stuck_sentence(const Line& l) const {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(settings_.stuck).count();
    return "line \"" + l.request.line + "\" of chip \"" + settings_.chip + "\" has been pressed for " + std::to_string(seconds) +
           " s: is it stuck, or gpio.active_low the wrong way round?";
  }

  void take(const Edge& edge) {
    Line& l = line(edge.slot);
    if (!l.open) return;
    if (const auto change = l.button.edge(edge.active, edge.at)) happened(l, *change);
    if (l.button.chatters())
      lose_line(edge.slot, "line \"" + l.request.line + "\" of chip \"" + settings_.chip + "\" chatters, with more than " +
                               std::to_string(settings_.edges_per_second) +
                               " edges a second: look for a loose contact, an unconnected wire or a missing gpio.bias");
  }

  void happened(Line& l, const ButtonChange& change) {
    switch (l.role) {
      case Role::start:
      case Role::toggle:
        if (settings_.long_press.count() <= 0) {
          if (change.active) report({short_press(l), change.at});
        } else if (change.active) {
          l.undecided = true;
          l.pressed = change.at;
        } else if (l.undecided) {
          decide(l, change.at);
        }
        break;
      case Role::stop:
        if (change.active) report({hal::TriggerKind::stop, change.at});
        break;
      case Role::emergency_stop:
        report_emergency(change.active, change.at);
        break;
      case Role::light:
      case Role::buzzer:
        break;
    }
  }

  static hal::TriggerKind short_press(const Line& l) { return l.role == Role::start ? hal::TriggerKind::start : hal::TriggerKind::toggle; }
  hal::MonotonicTime long_at(const Line& l) const { return l.pressed + settings_.long_press; }
  /// Let go then, or still pressed: by the times of the edges, so that a busy machine decides as an idle one.
  void decide(Line& l, hal::MonotonicTime until) {
    l.undecided = false;
    report({until >= long_at(l) ? hal::TriggerKind::calibrate : short_press(l), l.pressed});
  }

  /// Not readable is pressed.
  void watch_emergency_stop() {
    for (auto& l : lines_)
      if (l.role == Role::emergency_stop) report_emergency(!l.open || l.button.active(), clock_.now());
  }

  void report_emergency(bool pressed, hal::MonotonicTime at) {
    if (pressed == emergency_) return;
    emergency_ = pressed;
    report({pressed ? hal::TriggerKind::emergency_pressed : hal::TriggerKind::emergency_released, at});
  }

  void report(hal::TriggerEvent event) {
    {
      const std::lock_guard lock(mutex_);
      // Nobody listens: the oldest press is of no use any more, an emergency stop always is.
      if (events_.size() >= kEvents) {
        const auto press = std::find_if(events_.begin(), events_.end(), [](const auto& e) { return e.kind <= hal::TriggerKind::calibrate; });
        events_.erase(press == events_.end() ? events_.begin() : press);
      }
      events_.push_back(event);
    }
    heard_.notify_one();
  }

  Moment moment_of(Role role, hal::MonotonicTime now) {
    const std::lock_guard lock(mutex_);
    if (role == Role::light) return light_at(shown_, std::max(now - shown_since_, 0ns));
    return sound_ ? sound_at(*sound_, std::max(now - sound_since_, 0ns)) : Moment{};
  }

  void light() {
    for (int i = 0; i < count(); ++i) {
      Line& l = line(i);
      if (!l.open || !is_output(l.role)) continue;
      const bool on = moment_of(l.role, clock_.now()).on;
      if (on == l.lit) continue;
      with_line(i, [&] {
        chip_->set(i, on);
        l.lit = on;
      });
    }
  }

  void tell() {
    std::vector<std::string> problems;
    if (!chip_problem_.empty() && !chip_) problems.push_back(chip_problem_);
    for (const auto& l : lines_)
      if (!l.problem.empty()) problems.push_back(std::string(name_of(l.role)) + ": " + l.problem);
    for (const auto& l : lines_)
      if (l.role == Role::emergency_stop && !l.open) problems.push_back("emergency stop: it cannot be read and counts as pressed");
    const std::lock_guard lock(mutex_);
    if (problems != problems_) problems_ = std::move(problems);
  }

  void sleep() {
    const hal::MonotonicTime now = clock_.now();
    hal::Nanoseconds pause = chip_ ? kLook : std::min(kLook, chip_retry_.at() - now);
    for (const auto& l : lines_) {
      if (is_output(l.role) && l.open) pause = std::min(pause, moment_of(l.role, now).left);
      if (!is_output(l.role) && l.open && l.button.moving()) pause = std::min(pause, l.button.next() - now);
      if (l.open && l.undecided) pause = std::min(pause, long_at(l) - now);
      if (!l.open && chip_) pause = std::min(pause, l.retry.at() - now);
    }
    pause = std::max(pause, hal::Nanoseconds(0));
    if (!chip_) {
      std::unique_lock lock(chip_mutex_);
      rest_.wait_for(lock, pause, [&] { return stop_.load(); });
      return;
    }
    edges_.clear();
    try {
      chip_->wait(pause, edges_);
      for (const Edge& e : edges_) take(e);
    } catch (const Error& e) {
      lose_chip(e.what(), clock_.now());
    }
  }

  void wake() {
    const std::lock_guard lock(chip_mutex_);
    if (chip_) chip_->wake();
    rest_.notify_all();
  }

  const std::unique_ptr<ChipSource> chips_;
  const PanelSettings settings_;
  const hal::Clock& clock_;

  // The panel thread's alone.
  std::vector<Line> lines_;
  std::vector<Edge> edges_;
  std::string chip_problem_;
  Retry chip_retry_;
  hal::MonotonicTime chip_opened_{}, last_look_{};
  bool emergency_ = false;

  std::mutex chip_mutex_;  ///< guards the pointer against wake(); only the panel's thread changes it
  std::unique_ptr<Chip> chip_;
  std::condition_variable rest_;

  mutable std::mutex mutex_;  ///< guards what follows
  std::condition_variable heard_;
  std::deque<hal::TriggerEvent> events_;
  hal::LightShow shown_;
  hal::MonotonicTime shown_since_{}, sound_since_{};
  std::optional<hal::Sound> sound_;
  std::vector<std::string> problems_;

  std::atomic<std::uint64_t> progress_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<hal::Panel> make_gpio_panel(std::unique_ptr<ChipSource> chips, PanelSettings settings, const hal::Clock& clock) {
  return std::make_unique<GpioPanel>(std::move(chips), std::move(settings), clock);
}

}  // namespace booth::drivers::gpio
