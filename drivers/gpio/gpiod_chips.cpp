// The one file that talks to libgpiod (1.6): a change to its 2.x interface is a change here and nowhere else.
#include "drivers/gpio/gpiod_chips.hpp"

#include <gpiod.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <ctime>
#include <filesystem>
#include <system_error>

namespace booth::drivers::gpio {
namespace {

using namespace std::chrono_literals;

constexpr const char* kConsumer = "boothd";
constexpr hal::Nanoseconds kOldestEdge = 10s;  ///< kernels before 5.7 stamped with wall time; such a stamp is not of this clock

struct CloseChip {
  void operator()(gpiod_chip* chip) const { ::gpiod_chip_close(chip); }
};
using ChipHandle = std::unique_ptr<gpiod_chip, CloseChip>;

std::string text(const char* s) { return s == nullptr ? "" : s; }
std::string quoted(const std::string& s) { return "\"" + s + "\""; }
std::string reason(int error) { return std::generic_category().message(error); }

std::vector<std::string> chip_paths() {
  std::vector<std::string> out;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", error))
    if (entry.path().filename().string().starts_with("gpiochip")) out.push_back(entry.path().string());
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.size() != b.size() ? a.size() < b.size() : a < b; });
  return out;
}

hal::MonotonicTime now() {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return hal::MonotonicTime(std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec));
}

[[noreturn]] void throw_line_error(int error, const std::string& what) {
  if (error == ENODEV || error == EBADF) throw Error(Fault::gone, what + ": the chip is gone; plug it in again");
  throw Error(Fault::io, what + ": " + reason(error));
}

class GpiodChip final : public Chip {
 public:
  GpiodChip(ChipHandle chip, std::string name) : chip_(std::move(chip)), name_(std::move(name)), bell_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (bell_ < 0) throw Error(Fault::io, "chip " + quoted(name_) + ": no event descriptor: " + reason(errno));
  }
  ~GpiodChip() override {
    for (int i = 0; i < kSlots; ++i) release(i);
    ::close(bell_);
  }
  GpiodChip(const GpiodChip&) = delete;

  void request(int slot, const LineRequest& request) override {
    release(slot);
    gpiod_line* line = find(request.line);
    int flags = request.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    if (!request.output && request.bias == Bias::disabled) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE;
    if (!request.output && request.bias == Bias::pull_up) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
    if (!request.output && request.bias == Bias::pull_down) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
    const int status =
        request.output ? ::gpiod_line_request_output_flags(line, kConsumer, flags, 0) : ::gpiod_line_request_both_edges_events_flags(line, kConsumer, flags);
    if (status != 0) refuse(line, request, errno);
    slots_[index(slot)] = {line, request.output ? -1 : ::gpiod_line_event_get_fd(line), request.line};
  }

  void release(int slot) noexcept override {
    Slot& s = slots_[index(slot)];
    if (s.line != nullptr) ::gpiod_line_release(s.line);
    s = {};
  }

  bool level(int slot) override {
    const Slot& s = slots_[index(slot)];
    const int value = ::gpiod_line_get_value(s.line);
    if (value < 0) throw_line_error(errno, where(s.name) + " cannot be read");
    return value != 0;
  }

  void set(int slot, bool active) override {
    const Slot& s = slots_[index(slot)];
    if (::gpiod_line_set_value(s.line, active ? 1 : 0) != 0) throw_line_error(errno, where(s.name) + " cannot be set");
  }

  void wait(hal::Nanoseconds timeout, std::vector<Edge>& out) override {
    std::array<pollfd, kSlots + 1> fds;
    for (std::size_t i = 0; i < kSlots; ++i) fds[i] = {slots_[i].fd, POLLIN | POLLPRI, 0};  // poll() passes over negative ones
    fds[kSlots] = {bell_, POLLIN, 0};
    const auto whole = std::chrono::duration_cast<std::chrono::seconds>(std::max(timeout, hal::Nanoseconds(0)));
    const timespec limit{whole.count(), (std::max(timeout, hal::Nanoseconds(0)) - whole).count()};
    const int ready = ::ppoll(fds.data(), fds.size(), &limit, nullptr);
    if (ready < 0 && errno != EINTR) throw Error(Fault::io, "chip " + quoted(name_) + " cannot be waited for: " + reason(errno));
    if (ready <= 0) return;
    if (fds[kSlots].revents != 0) {
      std::uint64_t rings = 0;
      [[maybe_unused]] const auto read = ::read(bell_, &rings, sizeof rings);
    }
    const auto first = static_cast<std::ptrdiff_t>(out.size());
    for (std::size_t i = 0; i < kSlots; ++i) {
      if ((fds[i].revents & (POLLIN | POLLPRI)) != 0)
        read_edges(static_cast<int>(i), out);
      else if (fds[i].revents != 0)
        throw Error(Fault::gone, where(slots_[i].name) + ": the chip is gone; plug it in again");
    }
    std::stable_sort(out.begin() + first, out.end(), [](const Edge& a, const Edge& b) { return a.at < b.at; });
  }

  void wake() noexcept override {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(bell_, &one, sizeof one);
  }

 private:
  struct Slot {
    gpiod_line* line = nullptr;
    int fd = -1;  ///< of events; -1 for outputs
    std::string name;
  };
  static std::size_t index(int slot) { return static_cast<std::size_t>(slot); }
  std::string where(const std::string& line) const { return "line " + quoted(line) + " of chip " + quoted(name_); }

  gpiod_line* find(const std::string& wanted) {
    const unsigned count = ::gpiod_chip_num_lines(chip_.get());
    gpiod_line* found = nullptr;
    for (unsigned i = 0; i < count; ++i) {
      gpiod_line* line = ::gpiod_chip_get_line(chip_.get(), i);
      if (line == nullptr) throw_line_error(errno, "line " + std::to_string(i) + " of chip " + quoted(name_) + " cannot be examined");
      if (text(::gpiod_line_name(line)) != wanted) continue;
      if (found != nullptr) throw Error(Fault::no_line, where(wanted) + ": two lines bear this name; say its offset instead");
      found = line;
    }
    if (found != nullptr) return found;
    unsigned offset = 0;
    const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), offset);
    if (error == std::errc() && end == wanted.data() + wanted.size() && offset < count) return ::gpiod_chip_get_line(chip_.get(), offset);
    throw Error(Fault::no_line,
                where(wanted) + " does not exist: the chip has " + std::to_string(count) + " lines, none of this name; `boothctl doctor` lists them");
  }

  [[noreturn]] void refuse(gpiod_line* line, const LineRequest& request, int error) {
    if (error == EBUSY) {
      const bool known = ::gpiod_line_update(line) == 0 && ::gpiod_line_consumer(line) != nullptr;
      throw Error(Fault::busy, where(request.line) + " is used by " + (known ? quoted(text(::gpiod_line_consumer(line))) : "somebody else") +
                                   "; free it, or name another line");
    }
    if (error == EACCES || error == EPERM) throw Error(Fault::access, where(request.line) + " is not permitted; see systemd/91-boothd-gpio.rules");
    if (!request.output && (error == ENXIO || error == EINVAL || error == ENOTSUP || error == ENOENT))
      throw Error(Fault::unsupported, where(request.line) + " cannot report edges: its chip has no interrupt for it; name another line");
    throw_line_error(error, where(request.line) + " cannot be had");
  }

  void read_edges(int slot, std::vector<Edge>& out) {
    std::array<gpiod_line_event, 16> events;
    const int count = ::gpiod_line_event_read_fd_multiple(slots_[index(slot)].fd, events.data(), events.size());
    if (count < 0) throw_line_error(errno, where(slots_[index(slot)].name) + " cannot be read");
    const hal::MonotonicTime read = now();
    for (int i = 0; i < count; ++i) {
      const auto& e = events[static_cast<std::size_t>(i)];
      hal::MonotonicTime at(std::chrono::seconds(e.ts.tv_sec) + std::chrono::nanoseconds(e.ts.tv_nsec));
      if (at > read || read - at > kOldestEdge) at = read;
      out.push_back({slot, e.event_type == GPIOD_LINE_EVENT_RISING_EDGE, at});
    }
  }

  ChipHandle chip_;
  const std::string name_;
  const int bell_;
  std::array<Slot, kSlots> slots_;
};

class GpiodChips final : public ChipSource {
 public:
  std::unique_ptr<Chip> open(const std::string& wanted) override {
    std::string there, forbidden;
    ChipHandle found;
    for (const auto& path : chip_paths()) {
      ChipHandle chip(::gpiod_chip_open(path.c_str()));
      if (!chip) {
        if (errno == EACCES || errno == EPERM) forbidden = path;
        continue;
      }
      const std::string name = text(::gpiod_chip_name(chip.get())), label = text(::gpiod_chip_label(chip.get()));
      there += (there.empty() ? "" : ", ") + name + (label.empty() ? "" : " (" + label + ")");
      if (wanted != name && wanted != label && wanted != path) continue;
      if (found) throw Error(Fault::no_chip, "gpio.chip " + quoted(wanted) + ": two chips bear this label; name one by its path");
      found = std::move(chip);
    }
    if (found) return std::make_unique<GpiodChip>(std::move(found), wanted);
    if (!forbidden.empty())
      throw Error(Fault::access, "gpio.chip " + quoted(wanted) + " was not found, and " + forbidden + " may not be opened; see systemd/91-boothd-gpio.rules");
    throw Error(Fault::no_chip, "gpio.chip " + quoted(wanted) + " is not there: this machine has " + (there.empty() ? "no GPIO chip" : there) +
                                    "; plug it in, or name one that is there");
  }
};

}  // namespace

std::unique_ptr<ChipSource> make_gpiod_chips() { return std::make_unique<GpiodChips>(); }

hal::GpioChips list_gpiod_chips() {
  hal::GpioChips out;
  for (const auto& path : chip_paths()) {
    hal::GpioChipInfo info{.path = path, .name = {}, .label = {}, .problem = {}, .lines = {}};
    const ChipHandle chip(::gpiod_chip_open(path.c_str()));
    if (!chip) {
      info.problem = reason(errno);
      out.push_back(std::move(info));
      continue;
    }
    info.name = text(::gpiod_chip_name(chip.get()));
    info.label = text(::gpiod_chip_label(chip.get()));
    for (unsigned i = 0; i < ::gpiod_chip_num_lines(chip.get()); ++i) {
      gpiod_line* line = ::gpiod_chip_get_line(chip.get(), i);
      if (line == nullptr) break;
      info.lines.push_back({.offset = i,
                            .name = text(::gpiod_line_name(line)),
                            .consumer = text(::gpiod_line_consumer(line)),
                            .used = ::gpiod_line_is_used(line),
                            .output = ::gpiod_line_direction(line) == GPIOD_LINE_DIRECTION_OUTPUT});
    }
    out.push_back(std::move(info));
  }
  return out;
}

}  // namespace booth::drivers::gpio
