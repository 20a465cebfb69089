// Hears with BoothListener, draws with stick_figure.
#include "daemon/ctl/watch_network.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/ctl/stick_figure.hpp"

namespace booth::daemon {
namespace {

using Clock = std::chrono::steady_clock;

bool drawn(const HeardBooth& b) { return b.skeleton_known && b.present && b.skeleton.person != 0; }

std::string summary(const std::string& id, const HeardBooth& b) {
  if (!b.skeleton_known) return fmt::format("{:<16} found, and silent so far", printable(id));
  if (!b.present) return fmt::format("{:<16} gone", printable(id));
  std::string out = fmt::format("{:<16} {:<10} {:<9}", printable(id), session_state_name(b.skeleton.state), person_state_name(b.skeleton.person));
  if (drawn(b)) out += fmt::format(" frame {:>6}", b.skeleton.frame);
  if (b.status_known && drawn(b)) out += fmt::format("  {:4.1f} frames/s", b.status.fps);
  if (drawn(b) && std::isfinite(b.skeleton.residual)) out += fmt::format("  residual {:4.1f} mm", 1e3 * b.skeleton.residual);
  return out + fmt::format("  {} heard, {} lost", b.skeletons, b.skeletons_lost);
}

std::string json_line(const std::string& id, const HeardBooth& b) {
  using Json = nlohmann::ordered_json;
  Json j{{"booth", id},
         {"serial_number", b.skeleton.serial_number},
         {"frame", b.skeleton.frame},
         {"capture_utc_ns", b.skeleton.capture_utc_ns},
         {"state", session_state_name(b.skeleton.state)},
         {"person", person_state_name(b.skeleton.person)},
         {"residual", b.skeleton.residual}};
  if (drawn(b)) j["joints"] = b.skeleton.joints;
  return j.dump(-1, ' ', true, Json::error_handler_t::replace);
}

std::pair<int, int> terminal_size() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col < 20 || size.ws_row < 8) return {80, 24};
  return {std::min<int>(size.ws_col, 400), std::min<int>(size.ws_row, 200)};
}

}  // namespace

std::string fleet_figures(const std::map<std::string, HeardBooth>& booths, int columns, int rows) {
  constexpr int kNarrowest = 26;
  std::vector<std::pair<std::string, const HeardBooth*>> shown;
  for (const auto& [id, b] : booths)
    if (drawn(b)) shown.emplace_back(id, &b);
  if (shown.empty()) return "";
  shown.resize(std::min<std::size_t>(shown.size(), static_cast<std::size_t>(std::max(1, columns / kNarrowest))));
  const int width = std::min(76, columns / static_cast<int>(shown.size()) - 1);
  std::vector<std::string> lines(static_cast<std::size_t>(rows) + 1);
  for (const auto& [id, b] : shown) {
    const std::string name = printable(id, 32);
    lines[0] += fmt::format("{:^{}} ", name, width);
    std::istringstream figure(stick_figure(b->skeleton.joints, width, rows));
    for (std::size_t r = 1; r < lines.size(); ++r) {
      std::string line;
      std::getline(figure, line);
      lines[r] += line + " ";
    }
  }
  std::string out;
  for (const auto& line : lines) out += line + "\n";
  return out;
}

void watch_network(const NetworkWatch& watch) {
  BoothListener listener(watch.settings);
  const bool terminal = ::isatty(STDOUT_FILENO) && !watch.json;
  const auto begin = Clock::now();
  const auto pause = terminal ? std::chrono::milliseconds(100) : std::chrono::milliseconds(1000);
  std::map<std::string, std::uint64_t> said;
  auto next = begin + pause;
  while (std::cout.good()) {
    const auto now = Clock::now();
    const double elapsed = std::chrono::duration<double>(now - begin).count();
    if (watch.seconds > 0 && elapsed > watch.seconds) return;
    listener.poll(std::chrono::milliseconds(50));
    if (watch.json) {
      for (const auto& [id, b] : listener.booths())
        if (b.skeleton_known && std::exchange(said[id], b.skeletons) != b.skeletons) std::cout << json_line(id, b) << "\n";
      std::cout << std::flush;
      continue;
    }
    if (now < next) continue;
    next = now + pause;
    std::string out;
    for (const auto& [id, b] : listener.booths()) out += summary(id, b) + "\n";
    if (out.empty()) out = fmt::format("{:5.1f} s  no booth heard yet (dds.domain {})\n", elapsed, watch.settings.domain);
    if (terminal) {
      const auto [columns, rows] = terminal_size();
      const auto lines = static_cast<int>(std::count(out.begin(), out.end(), '\n'));
      std::cout << "\033[H\033[2J" << out << fleet_figures(listener.booths(), columns, std::max(8, rows - lines - 2));
    } else {
      std::cout << out;
    }
    std::cout << std::flush;
  }
}

}  // namespace booth::daemon
