// Few writes, each to a file that was opened before the first of them.
#include "drivers/usb/power_control.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>
#include <utility>

#include "drivers/usb/sysfs_topology.hpp"
#include "drivers/usb/usb_names.hpp"

namespace booth::drivers::usb {
namespace {

using namespace std::chrono_literals;
using Result = PowerOutcome::Result;

constexpr hal::Nanoseconds kWithoutPower = 2s, kUnbound = 1s, kBindPause = 500ms;
constexpr int kBindTries = 5;
constexpr int kHubClass = 9;
constexpr int kMostUsbfsMemory = 1024;  ///< MiB; four sensors take about 50

/// An attribute opened for writing.
class Attribute {
 public:
  explicit Attribute(const std::filesystem::path& file)
      : fd_(::open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)), error_(fd_ < 0 ? errno : 0) {
    struct stat s {};
    if (fd_ >= 0 && (::fstat(fd_, &s) != 0 || !S_ISREG(s.st_mode))) error_ = EINVAL;
  }
  ~Attribute() {
    if (fd_ >= 0) ::close(fd_);
  }
  Attribute(const Attribute&) = delete;
  Attribute& operator=(const Attribute&) = delete;

  int error() const { return error_; }
  bool write(const std::string& text) {
    if (error_ == 0 && ::pwrite(fd_, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size())) return true;
    if (error_ == 0) last_ = errno;
    return false;
  }
  std::string why() const { return std::generic_category().message(error_ != 0 ? error_ : last_); }

 private:
  const int fd_;
  int error_, last_ = 0;
};

PowerOutcome cannot_open(const Attribute& attribute, const std::string& what) {
  const int e = attribute.error();
  const bool permission = e == EACCES || e == EPERM || e == EROFS;
  return {permission ? Result::not_permitted : Result::failed, what + ": " + attribute.why()};
}

}  // namespace

PowerControl::PowerControl(std::function<bool(const hal::UsbDevice&)> ours, std::filesystem::path root, std::function<void(hal::Nanoseconds)> pause)
    : ours_(std::move(ours)),
      sysfs_(root),
      topology_(make_sysfs_topology(std::move(root))),
      pause_(pause ? std::move(pause) : [](hal::Nanoseconds t) { std::this_thread::sleep_for(t); }) {
  (void)look();
}

hal::UsbTopology PowerControl::look() {
  auto seen = topology_->read();
  for (const auto& controller : seen.controllers)
    for (const auto& bus : controller.buses) controllers_[bus.number] = controller.id;
  return seen;
}

PowerOutcome PowerControl::reset_port(const std::string& text) {
  const std::lock_guard lock(mutex_);
  const auto port = parse_port_name(text);
  if (!port) return {Result::refused, "\"" + text.substr(0, 32) + "\" is not the name of a USB port"};
  const auto seen = look();
  if (const auto* there = find_device(seen, text); there != nullptr && !ours_(*there))
    return {Result::refused, "port " + text + " is not switched off: something that is no camera is plugged in there"};
  const auto file = port_switch(sysfs_, *port);
  if (!file) return {Result::refused, "port " + text + " cannot be switched off by this kernel or hub"};
  Attribute disable(*file);
  if (disable.error() != 0) return cannot_open(disable, "port " + text + " cannot be switched off");
  if (!disable.write("1")) return {Result::failed, "port " + text + " could not be switched off: " + disable.why()};
  pause_(kWithoutPower);
  for (int i = 0; i < kBindTries; ++i) {
    if (disable.write("0")) return {Result::done, "port " + text + " was without power for two seconds"};
    pause_(kBindPause);
  }
  return {Result::failed, "port " + text + " was switched off and could not be switched on again: " + disable.why() + "; plug the camera into another port"};
}

PowerOutcome PowerControl::rebind_controller(const std::string& text) {
  const std::lock_guard lock(mutex_);
  const auto port = parse_port_name(text);
  if (!port) return {Result::refused, "\"" + text.substr(0, 32) + "\" is not the name of a USB port"};
  const auto seen = look();
  const auto known = controllers_.find(port->bus);
  const auto* controller = known == controllers_.end() ? nullptr : find_controller(seen, known->second);
  if (controller == nullptr || !controller->on_pci || !is_pci_address(controller->id) || !is_xhci_driver(controller->driver))
    return {Result::refused, "port " + text + " belongs to no xHCI controller on PCI that could be bound anew"};
  for (const auto& d : seen.devices)
    if (d.controller == controller->id && parse_port_name(d.path) && d.path != text && d.device_class != kHubClass)
      return {Result::refused, "controller " + controller->id + " is not bound anew: the device at port " + d.path + " hangs on it too"};
  return rebind(*controller);
}

PowerOutcome PowerControl::rebind_controller_at(const std::string& address) {
  const std::lock_guard lock(mutex_);
  const auto seen = look();
  const auto* controller = is_pci_address(address) ? find_controller(seen, address) : nullptr;
  if (controller == nullptr || !controller->on_pci || !is_xhci_driver(controller->driver))
    return {Result::refused, "\"" + address.substr(0, 32) + "\" is not the PCI address of an xHCI controller of this machine"};
  int ours = 0;
  for (const auto& d : seen.devices) {
    if (d.controller != address || !parse_port_name(d.path) || d.device_class == kHubClass) continue;
    ours += ours_(d);
    if (!ours_(d) || ours > 1) return {Result::refused, "controller " + address + " is not bound anew: the device at port " + d.path + " hangs on it too"};
  }
  return rebind(*controller);
}

std::string PowerControl::controller_of(const std::string& text) {
  const std::lock_guard lock(mutex_);
  const auto port = parse_port_name(text);
  if (!port) return "";
  (void)look();
  const auto known = controllers_.find(port->bus);
  return known == controllers_.end() ? "" : known->second;
}

PowerOutcome PowerControl::raise_usbfs_memory(const std::string& text) {
  const std::lock_guard lock(mutex_);
  const bool digits = !text.empty() && text.size() <= 4 && text.find_first_not_of("0123456789") == std::string::npos && text[0] != '0';
  const int wanted = digits ? std::stoi(text) : 0;
  if (wanted < 1 || wanted > kMostUsbfsMemory) return {Result::refused, "\"" + text.substr(0, 32) + "\" is no amount of usbfs memory: 1 to 1024 MiB"};
  const auto now = look().usbfs_memory_mb;
  if (!now) return {Result::failed, "this kernel shows no usbfs memory"};
  if (*now == 0 || *now >= wanted) return {Result::done, "usbfs memory is " + (*now == 0 ? std::string("without limit") : std::to_string(*now) + " MiB")};
  Attribute limit(sysfs_.at("sys/module/usbcore/parameters/usbfs_memory_mb"));
  if (limit.error() != 0) return cannot_open(limit, "usbfs memory cannot be raised");
  if (!limit.write(text)) return {Result::failed, "usbfs memory could not be raised: " + limit.why()};
  return {Result::done, "usbfs memory is " + text + " MiB now"};
}

PowerOutcome PowerControl::rebind(const hal::UsbController& controller) {
  const auto folder = sysfs_.at(pci_driver_folder(controller.driver));
  // Both before the first write: a controller that can be unbound but not bound would be lost.
  Attribute unbind(folder / "unbind"), bind(folder / "bind");
  if (unbind.error() != 0) return cannot_open(unbind, "controller " + controller.id + " cannot be unbound");
  if (bind.error() != 0) return cannot_open(bind, "controller " + controller.id + " cannot be bound");
  if (!unbind.write(controller.id)) return {Result::failed, "controller " + controller.id + " could not be unbound: " + unbind.why()};
  pause_(kUnbound);
  for (int i = 0; i < kBindTries; ++i) {
    if (bind.write(controller.id)) return {Result::done, "controller " + controller.id + " was bound anew"};
    pause_(kBindPause);
  }
  return {Result::failed, "controller " + controller.id + " was unbound and cannot be bound again: " + bind.why() + "; restart the machine"};
}

}  // namespace booth::drivers::usb
