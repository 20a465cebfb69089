// Doctor's look at buttons and light: whether the chip and its lines are there, free, and in the right direction.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "daemon/health/checks.hpp"

namespace booth::daemon {
namespace {

const char* const kPage = "; see docs/guide/buttons-and-light.md";

bool named(const hal::GpioChipInfo& chip, const std::string& wanted) { return wanted == chip.label || wanted == chip.name || wanted == chip.path; }

const hal::GpioLineInfo* find_line(const hal::GpioChipInfo& chip, const std::string& wanted) {
  for (const auto& line : chip.lines)
    if (line.name == wanted) return &line;
  unsigned offset = 0;
  const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), offset);
  const bool number = error == std::errc() && end == wanted.data() + wanted.size();
  return number && offset < chip.lines.size() ? &chip.lines[offset] : nullptr;
}

std::string list_chips(const hal::GpioChips& chips) {
  std::string out;
  for (const auto& chip : chips)
    out += (out.empty() ? "" : ", ") + (chip.name.empty() ? chip.path : chip.label.empty() ? chip.name : fmt::format("{} ({})", chip.name, chip.label));
  return out.empty() ? "this machine has no GPIO chip" : "there are " + out;
}

std::string list_names(const hal::GpioChipInfo& chip) {
  std::string out;
  for (const auto& line : chip.lines)
    if (!line.name.empty() && out.size() < 200) out += (out.empty() ? "" : ", ") + line.name;
  return fmt::format("it has {} lines{}{}", chip.lines.size(), out.empty() ? "" : ", named ", out);
}

Check check_line(const hal::GpioChipInfo& chip, const char* key, const std::string& wanted) {
  const hal::GpioLineInfo* line = find_line(chip, wanted);
  const std::string name = fmt::format("gpio.{}", key);
  if (line == nullptr)
    return {"gpio", name, CheckResult::error, fmt::format("{} has no line \"{}\"; {}", chip.name, wanted, list_names(chip)), "name one of them, or its offset"};
  const std::string where = fmt::format("line {} of {}{}", line->offset, chip.name, line->name.empty() ? "" : fmt::format(" (\"{}\")", line->name));
  if (std::count_if(chip.lines.begin(), chip.lines.end(), [&](const auto& l) { return l.name == wanted; }) > 1)
    return {"gpio", name, CheckResult::error, fmt::format("{} has two lines \"{}\"", chip.name, wanted), "say the line's offset instead of its name"};
  if (line->used && line->consumer != "boothd")
    return {"gpio", name, CheckResult::error, fmt::format("{} is used by \"{}\"", where, line->consumer.empty() ? "the kernel" : line->consumer),
            "free it, or name another line"};
  return {"gpio", name, CheckResult::ok, fmt::format("{} {}", where, line->used ? "is used by boothd" : "is free")};
}

}  // namespace

Checks check_gpio(const DoctorInputs& in) {
  const auto& keys = in.config.gpio;
  if (keys.chip.empty()) return {{"gpio", "chip", CheckResult::skipped, "gpio.chip is not set: the booth has neither button nor light"}};
  if (keys.chip == "simulated") return {{"gpio", "chip", CheckResult::ok, "simulated: press it with `boothctl press start`"}};
  if (!in.gpio) return {{"gpio", "chip", CheckResult::skipped, "lines can only be examined on the machine itself, without --root"}};
  const auto chip = std::find_if(in.gpio->begin(), in.gpio->end(), [&](const auto& c) { return named(c, keys.chip); });
  if (chip == in.gpio->end())
    return {{"gpio", "chip", CheckResult::error, fmt::format("gpio.chip \"{}\" is not there: {}", keys.chip, list_chips(*in.gpio)),
             std::string("plug it in, or name one that is there") + kPage}};
  if (!chip->problem.empty())
    return {{"gpio", "chip", CheckResult::error, fmt::format("{} cannot be opened: {}", chip->path, chip->problem),
             "install systemd/91-boothd-gpio.rules, and be a member of the group boothd"}};
  Checks out{{"gpio", "chip", CheckResult::ok, fmt::format("{} ({}), {} lines", chip->path, chip->label, chip->lines.size())}};
  const std::pair<const char*, const std::string&> wanted[]{
      {"start", keys.start}, {"stop", keys.stop}, {"emergency_stop", keys.emergency_stop}, {"light", keys.light}, {"buzzer", keys.buzzer}};
  for (const auto& [key, line] : wanted)
    if (!line.empty()) out.push_back(check_line(*chip, key, line));
  if (keys.emergency_stop.empty() && keys.start.empty()) out.push_back({"gpio", "buttons", CheckResult::warning, "the booth has no button", "set gpio.start"});
  return out;
}

}  // namespace booth::daemon
