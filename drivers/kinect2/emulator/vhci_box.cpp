// Ports of vhci_hcd, the sockets handed to it, and the devices at their other ends.
#include "drivers/kinect2/emulator/vhci_box.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "drivers/kinect2/emulator/usbip_device.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using namespace std::chrono_literals;

const std::string kController = "/sys/devices/platform/vhci_hcd.0/";
constexpr auto kRebootAbsence = 3s;
constexpr int kSuper = 5, kHigh = 3;  // enum usb_device_speed of the kernel
constexpr int kFreePort = 4;          // VDEV_ST_NULL
constexpr int kSocketBuffer = 4 << 20;

/// Status of each port, as the kernel lists it: "hs|ss number status speed device socket busid".
struct Port {
  std::string kind;
  int number = 0, status = 0;
};

std::vector<Port> ports() {
  std::ifstream in(kController + "status");
  std::string line;
  if (!std::getline(in, line)) throw std::runtime_error(kController + "status cannot be read: this kernel has no vhci_hcd");
  std::vector<Port> out;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    Port port;
    if (words >> port.kind >> port.number >> port.status) out.push_back(port);
  }
  return out;
}

void write_file(const std::string& path, const std::string& text) {
  const int file = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  const bool ok = file >= 0 && write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  if (file >= 0) close(file);
  if (!ok) throw std::runtime_error(path + " does not take \"" + text + "\": " + std::strerror(error));
}

class Box final : public VhciBox {
 public:
  explicit Box(std::shared_ptr<hal::Clock> clock) : clock_(std::move(clock)), keeper_([this] { keep(); }) {}
  ~Box() override {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    keeper_.join();
    for (Slot& slot : slots_) {
      try {
        let_go(slot);
      } catch (const std::exception& e) {
        std::fprintf(stderr, "emulated sensors: %s\n", e.what());  // the port stays taken; whoever plugs in next is told so too
      }
    }
  }

  int add(VhciDeviceSettings settings) override {
    Slot slot{.settings = settings, .model = std::make_shared<DeviceModel>(settings.device)};
    slot.model->prepare_loop(clock_->now());
    const std::lock_guard lock(mutex_);
    slots_.push_back(std::move(slot));
    return static_cast<int>(slots_.size()) - 1;
  }

  void plug(int device) override {
    const std::lock_guard lock(mutex_);
    plug_locked(device);
  }

  void unplug(int device) override {
    const std::lock_guard lock(mutex_);
    Slot& slot = slots_.at(static_cast<std::size_t>(device));
    slot.back_at.reset();
    let_go(slot);
  }

  bool plugged(int device) const override {
    const std::lock_guard lock(mutex_);
    const Slot& slot = slots_.at(static_cast<std::size_t>(device));
    return slot.device && !slot.device->ended();
  }
  FaultPlan& faults(int device) override {
    const std::lock_guard lock(mutex_);
    return slots_.at(static_cast<std::size_t>(device)).model->faults();
  }
  std::vector<std::string> requests(int device) const override {
    const std::lock_guard lock(mutex_);
    return slots_.at(static_cast<std::size_t>(device)).model->log();
  }
  std::uint64_t packets_sent(int device) const override {
    const std::lock_guard lock(mutex_);
    const Slot& slot = slots_.at(static_cast<std::size_t>(device));
    return slot.device ? slot.device->packets_sent() : 0;
  }
  std::string error(int device) const override {
    const std::lock_guard lock(mutex_);
    const Slot& slot = slots_.at(static_cast<std::size_t>(device));
    return slot.device ? slot.device->error() : std::string();
  }

 private:
  struct Slot {
    VhciDeviceSettings settings;
    std::shared_ptr<DeviceModel> model;
    std::unique_ptr<UsbipDevice> device{};
    int port = -1;
    std::optional<hal::MonotonicTime> back_at{};
  };

  void plug_locked(int number) {
    Slot& slot = slots_.at(static_cast<std::size_t>(number));
    if (slot.device && !slot.device->ended()) throw std::runtime_error("emulated sensor " + std::to_string(number) + " is already plugged in");
    let_go(slot);
    slot.back_at.reset();
    const std::string kind = slot.settings.high_speed ? "hs" : "ss";
    for (const Port& port : ports()) {
      if (port.kind != kind || port.status != kFreePort) continue;
      attach(slot, number, port.number);
      return;
    }
    throw std::runtime_error("vhci_hcd has no free port for another sensor");
  }

  void attach(Slot& slot, int number, int port) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) throw std::runtime_error(std::string("no pair of sockets: ") + std::strerror(errno));
    for (const int end : ends) (void)setsockopt(end, SOL_SOCKET, SO_SNDBUF, &kSocketBuffer, sizeof kSocketBuffer);
    const auto id = 0x1'0000u + static_cast<std::uint32_t>(number);
    slot.model->bus_reset();
    const Identity identity{
        .serial = slot.settings.device.serial, .high_speed = slot.settings.high_speed, .bytes_per_interval = slot.settings.bytes_per_interval};
    slot.device = std::make_unique<UsbipDevice>(slot.model, identity, id, ends[0], clock_, slot.settings.packet_time);
    slot.port = port;
    try {
      write_file(kController + "attach", std::to_string(port) + " " + std::to_string(ends[1]) + " " + std::to_string(id) + " " +
                                             std::to_string(slot.settings.high_speed ? kHigh : kSuper));
    } catch (...) {
      slot.device.reset();
      close(ends[1]);
      throw;
    }
    close(ends[1]);  // the kernel has it
  }

  /// Ends the connection and waits, some seconds at most, until the port is free again.
  static void let_go(Slot& slot) {
    if (!slot.device) return;
    slot.device.reset();
    for (int i = 0; i < 500; ++i) {
      bool free = true;
      for (const Port& port : ports()) free = free && (port.number != slot.port || port.status == kFreePort);
      if (free) return;
      std::this_thread::sleep_for(10ms);
    }
    throw std::runtime_error("vhci_hcd does not let port " + std::to_string(slot.port) + " go");
  }

  /// Devices that were told to reboot come back.
  void keep() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
      wake_.wait_for(lock, 100ms);
      const auto now = clock_->now();
      for (std::size_t i = 0; i < slots_.size() && !stop_; ++i) {
        Slot& slot = slots_[i];
        if (!slot.device || !slot.device->ended() || !slot.device->rebooting()) continue;
        if (!slot.back_at) slot.back_at = now + kRebootAbsence;
        if (now < *slot.back_at) continue;
        try {
          plug_locked(static_cast<int>(i));
        } catch (const std::runtime_error&) {
          slot.back_at = now + kRebootAbsence;  // no free port; once more, later
        }
      }
    }
  }

  const std::shared_ptr<hal::Clock> clock_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::vector<Slot> slots_;
  std::thread keeper_;
};

}  // namespace

std::unique_ptr<VhciBox> make_vhci_box(std::shared_ptr<hal::Clock> clock) { return std::make_unique<Box>(std::move(clock)); }

}  // namespace booth::drivers::kinect2::emulator
