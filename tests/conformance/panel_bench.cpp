// The two benches: a board in memory, and gpio-sim through configfs and sysfs.
#include "tests/conformance/panel_bench.hpp"

#include <fcntl.h>
#include <gpiod.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "drivers/gpio/gpiod_chips.hpp"
#include "drivers/gpio/simulated_board.hpp"

namespace booth::tests {
namespace {

namespace gpio = drivers::gpio;
constexpr std::array<const char*, 5> kLines{"start", "stop", "emergency", "light", "buzzer"};

class SimulatedBench final : public PanelBench {
 public:
  explicit SimulatedBench(const hal::Clock& clock) : board_(clock, "booth-bench", {kLines.begin(), kLines.end()}) {}
  std::unique_ptr<gpio::ChipSource> chips() override { return gpio::make_simulated_chips(board_); }
  std::string chip() const override { return "booth-bench"; }
  void drive(const std::string& line, bool high) override { board_.drive(line, high); }
  bool high(const std::string& line) override { return board_.high(line); }
  void unplug() override { board_.unplug(); }
  void plug_in() override { board_.plug_in(); }
  void occupy(const std::string& line) override { board_.occupy(occupied_ = line, "another"); }
  void leave() override { board_.leave(occupied_); }

 private:
  gpio::SimulatedBoard board_;
  std::string occupied_;
};

const std::filesystem::path kConfigfs = "/sys/kernel/config/gpio-sim";

/// The kernel's chip (Documentation/admin-guide/gpio/gpio-sim.rst).
class KernelBench final : public PanelBench {
 public:
  KernelBench() : folder_(kConfigfs / ("booth-bench-" + std::to_string(::getpid()))) {
    std::filesystem::create_directory(folder_);
    std::filesystem::create_directory(bank());
    write(bank() / "num_lines", "8");
    write(bank() / "label", "booth-bench");
    for (std::size_t i = 0; i < kLines.size(); ++i) {
      const auto line = bank() / ("line" + std::to_string(i));
      std::filesystem::create_directory(line);
      write(line / "name", kLines[i]);
    }
    plug_in();
  }
  ~KernelBench() override {
    leave();
    try {
      unplug();
    } catch (const std::exception&) {
    }
    for (std::size_t i = 0; i < kLines.size(); ++i) ::rmdir((bank() / ("line" + std::to_string(i))).c_str());
    ::rmdir(bank().c_str());
    ::rmdir(folder_.c_str());
  }
  KernelBench(const KernelBench&) = delete;

  std::unique_ptr<gpio::ChipSource> chips() override { return gpio::make_gpiod_chips(); }
  std::string chip() const override { return "booth-bench"; }
  void drive(const std::string& line, bool high) override {
    driven_[line] = high;
    if (live_) write(attribute(line, "pull"), high ? "pull-up" : "pull-down");
  }
  bool high(const std::string& line) override { return live_ && read(attribute(line, "value")) == "1"; }
  void unplug() override {
    if (live_) write(folder_ / "live", "0");
    live_ = false;
  }
  void plug_in() override {
    if (live_) return;
    write(folder_ / "live", "1");
    live_ = true;
    chip_folder_ = std::filesystem::path("/sys/devices/platform") / read(folder_ / "dev_name") / read(bank() / "chip_name");
    for (const auto& [line, high] : driven_) drive(line, high);
  }
  void occupy(const std::string& line) override {
    chip_.reset(::gpiod_chip_open_by_label("booth-bench"));
    gpiod_line* taken = chip_ ? ::gpiod_chip_find_line(chip_.get(), line.c_str()) : nullptr;
    if (taken == nullptr || ::gpiod_line_request_input(taken, "another") != 0) throw std::runtime_error("line " + line + " cannot be occupied");
  }
  void leave() override { chip_.reset(); }

 private:
  struct Close {
    void operator()(gpiod_chip* chip) const { ::gpiod_chip_close(chip); }
  };
  std::filesystem::path bank() const { return folder_ / "bank0"; }
  std::filesystem::path attribute(const std::string& line, const char* name) const {
    for (std::size_t i = 0; i < kLines.size(); ++i)
      if (line == kLines[i]) return chip_folder_ / ("sim_gpio" + std::to_string(i)) / name;
    throw std::invalid_argument("the bench has no line " + line);
  }
  static void write(const std::filesystem::path& file, const std::string& text) {
    const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
    const bool good = fd >= 0 && ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
    const int error = errno;
    if (fd >= 0) ::close(fd);
    if (!good) throw std::runtime_error(file.string() + ": " + std::generic_category().message(error));
  }
  static std::string read(const std::filesystem::path& file) {
    std::ifstream in(file);
    std::string out;
    std::getline(in, out);
    return out;
  }

  const std::filesystem::path folder_;
  std::filesystem::path chip_folder_;
  bool live_ = false;
  std::map<std::string, bool> driven_;
  std::unique_ptr<gpiod_chip, Close> chip_;
};

}  // namespace

std::string why_no_bench(BenchKind kind) {
  if (kind == BenchKind::simulated) return "";
  if (std::getenv("BOOTH_GPIO_SIM") == nullptr) return "gpio-sim is used in the virtual booth only (toolchain/virtual-booth gpio)";
  std::error_code error;
  return std::filesystem::is_directory(kConfigfs, error) ? "" : "this kernel has no gpio-sim, or configfs is not mounted";
}

std::unique_ptr<PanelBench> make_bench(BenchKind kind, const hal::Clock& clock) {
  if (kind == BenchKind::simulated) return std::make_unique<SimulatedBench>(clock);
  return std::make_unique<KernelBench>();
}

const char* name_of(BenchKind kind) { return kind == BenchKind::simulated ? "simulated" : "gpio_sim"; }

}  // namespace booth::tests
