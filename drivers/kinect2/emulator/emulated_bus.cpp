// The bus, its devices, and the thread of each stream that sends what a sensor would send.
#include "drivers/kinect2/emulator/emulated_bus.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/emulator/colour_source.hpp"
#include "drivers/kinect2/emulator/device_model.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

using namespace std::chrono_literals;
using usb::Status;

/// Times of a stepped device: those of Pace::fast elsewhere.
constexpr hal::MonotonicTime kSteppedOrigin{1s};
constexpr hal::Nanoseconds kSteppedDelay = 45ms;
/// From the middle of an exposure to its last packet, as the driver assumes it.
constexpr hal::Nanoseconds kReadout = 30ms;

/// A device and whether its plug is in.
struct Slot {
  Slot(EmulatedDeviceSettings settings, int place) : model(std::move(settings)), number(place) {}
  DeviceModel model;
  const int number;
  std::atomic<int> address{1};
  std::atomic<bool> plugged{true};
  std::atomic<int> steps{0};
  std::atomic<std::int64_t> sent{0};  ///< frames of a stepped device, over all of its streams
  bool take_step() {
    for (int n = steps; n > 0;)
      if (steps.compare_exchange_weak(n, n - 1)) return true;
    return false;
  }
  std::atomic<std::int64_t> back_at{0};  ///< monotonic nanoseconds; until then it is away by itself
};

class EmulatedStream final : public usb::Stream {
 public:
  EmulatedStream(std::shared_ptr<Slot> slot, hal::Clock& clock, usb::StreamSettings settings, usb::StreamSink& sink)
      : slot_(std::move(slot)), clock_(clock), settings_(settings), sink_(sink), thread_([this] { run(); }) {}
  ~EmulatedStream() override { stop(3s); }

  bool stop(hal::Nanoseconds) noexcept override {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return true;
  }
  int transfers_alive() const override { return stop_ ? 0 : settings_.transfers; }

 private:
  void run() {
    Sender sender(*this);
    while (!stop_) {
      if (!slot_->plugged) return sink_.on_end(Status::no_device);
      if (!(slot_->model.settings().stepped ? sender.step() : sender.next())) std::this_thread::sleep_for(500us);
    }
    sink_.on_end(Status::cancelled);
  }

  /// What the stream's thread has in hand.
  class Sender {
   public:
    explicit Sender(EmulatedStream& stream) : s_(stream), model_(stream.slot_->model), infrared_(model_) {
      if (!s_.settings_.isochronous) colour_.emplace(model_);
      send_ = [this](Status status, std::span<const std::byte> data) {
        s_.sink_.on_packet(status, data, model_.settings().stepped ? arrived_ : s_.clock_.now());
        return !s_.stop_ && s_.slot_->plugged;
      };
    }
    /// A frame for each step that a test allows, at the time that its rate says.
    bool step() {
      if (!streams() || !s_.slot_->take_step()) return false;
      exposure_ = kSteppedOrigin + model_.frame_period() * s_.slot_->sent++;
      arrived_ = exposure_ + kSteppedDelay;
      expose();
      send();
      return true;
    }
    /// Exposures lie on a grid that all devices of one rate share; each is made ahead of time and sent when a sensor would have it.
    bool next() {
      const auto now = s_.clock_.now();
      if (!streams()) return exposed_ = false;
      if (!exposed_) {
        const auto period = model_.frame_period();
        exposure_ = std::max(exposure_ + period, hal::MonotonicTime((now.time_since_epoch() / period + 1) * period));
        expose();
        exposed_ = true;
        return true;
      }
      if (now < exposure_ + kReadout) return false;
      send();
      exposed_ = false;
      return true;
    }

   private:
    bool streams() const { return colour_ ? model_.streams_colour() : model_.streams_infrared(); }
    void expose() {
      if (!colour_) infrared_.expose(exposure_);
    }
    void send() {
      if (colour_) {
        colour_->send_message(exposure_, s_.settings_.packet_bytes, send_);
      } else {
        infrared_.send_exposed(send_);
      }
    }
    EmulatedStream& s_;
    DeviceModel& model_;
    InfraredSource infrared_;
    std::optional<ColourSource> colour_;
    std::function<bool(Status, std::span<const std::byte>)> send_;
    hal::MonotonicTime exposure_{}, arrived_{};
    bool exposed_ = false;
  };

  const std::shared_ptr<Slot> slot_;
  hal::Clock& clock_;
  const usb::StreamSettings settings_;
  usb::StreamSink& sink_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class EmulatedDevice final : public usb::Device {
 public:
  EmulatedDevice(std::shared_ptr<Slot> slot, usb::DeviceInfo info, std::shared_ptr<hal::Clock> clock, Absences absences, std::function<void(Slot&)> changed)
      : slot_(std::move(slot)), info_(std::move(info)), clock_(std::move(clock)), absences_(absences), changed_(std::move(changed)), address_(slot_->address) {
    slot_->model.bus_reset();
  }
  ~EmulatedDevice() override {
    if (there() && slot_->model.faults().take(Fault::vanish_after_close)) leave(absences_.close);
  }

  const usb::DeviceInfo& info() const override { return info_; }
  int configuration() override {
    require("configuration");
    return 1;
  }
  void set_configuration(int) override { require("configuration"); }
  void claim(int interface) override { require("claim " + std::to_string(interface)); }
  void release(int) noexcept override {}
  void set_alternate(int interface, int alternate) override {
    require("alternate " + std::to_string(interface) + " " + std::to_string(alternate));
    if (alternate == 1 && slot_->model.faults().take(Fault::alternate_refused))
      throw usb::Error(usb::Fault::no_bandwidth, "the controller has no bandwidth left: give each Kinect v2 a controller of its own");
    slot_->model.set_alternate(alternate);
  }
  std::size_t bytes_per_interval(int interface, int alternate, std::uint8_t endpoint) override {
    return interface == kStreamInterface && alternate == 1 && endpoint == kInfraredIn ? slot_->model.settings().bytes_per_interval : 0;
  }
  void control_out(const usb::ControlRequest& request, std::span<const std::byte>, hal::Nanoseconds) override {
    require("control " + std::to_string(request.type) + " " + std::to_string(request.request) + " " + std::to_string(request.value) + " " +
            std::to_string(request.index));
    slot_->model.control(request);
  }
  usb::TransferResult bulk_out(std::uint8_t, std::span<const std::byte> data, hal::Nanoseconds) override {
    if (!request("command")) return {Status::no_device, 0};
    slot_->model.command(data);
    if (slot_->model.wants_reboot()) leave(absences_.reboot);
    return {Status::completed, data.size()};
  }
  usb::TransferResult bulk_in(std::uint8_t endpoint, std::span<std::byte> data, hal::Nanoseconds timeout) override {
    if (!request("answer")) return {Status::no_device, 0};
    std::vector<std::byte> reply;
    if (endpoint != kReplyIn || !slot_->model.take_reply(reply)) {
      std::this_thread::sleep_for(std::min<hal::Nanoseconds>(timeout, 50ms));  // a test need not wait out a whole second
      return {Status::timed_out, 0};
    }
    if (reply.size() > data.size()) return {Status::overflow, 0};
    std::copy(reply.begin(), reply.end(), data.begin());
    return {Status::completed, reply.size()};
  }
  void reset() override {
    require("reset");
    slot_->model.bus_reset();
  }
  std::unique_ptr<usb::Stream> open_stream(const usb::StreamSettings& settings, usb::StreamSink& sink) override {
    require("stream");
    return std::make_unique<EmulatedStream>(slot_, *clock_, settings, sink);
  }

 private:
  bool there() const { return slot_->plugged && slot_->address == address_; }
  void leave(hal::Nanoseconds duration) {
    slot_->back_at = (clock_->now() + duration).time_since_epoch().count();
    slot_->plugged = false;
    changed_(*slot_);
  }
  bool request(const std::string& line) {
    if (!there()) return false;
    slot_->model.note(line);
    if (!slot_->model.faults().take(Fault::unplug_on_request)) return true;
    slot_->plugged = false;
    changed_(*slot_);
    return false;
  }
  void require(const std::string& line) {
    if (!request(line)) throw usb::Error(usb::Fault::no_device, "Kinect v2 " + info_.serial + " left the bus: check its cable and its mains adaptor");
  }

  const std::shared_ptr<Slot> slot_;
  const usb::DeviceInfo info_;
  const std::shared_ptr<hal::Clock> clock_;
  const Absences absences_;
  const std::function<void(Slot&)> changed_;
  const int address_;
};

class Box final : public EmulatedBus {
 public:
  Box(std::shared_ptr<hal::Clock> clock, Absences absences) : clock_(std::move(clock)), absences_(absences) {}

  int add(EmulatedDeviceSettings settings) override {
    const std::lock_guard lock(mutex_);
    slots_.push_back(std::make_shared<Slot>(std::move(settings), static_cast<int>(slots_.size())));
    ++changes_;
    return static_cast<int>(slots_.size()) - 1;
  }
  void unplug(int device) override {
    slot(device)->back_at = 0;
    slot(device)->plugged = false;
    ++changes_;
  }
  void plug(int device) override {
    const auto s = slot(device);
    s->model.bus_reset();
    ++s->address;
    s->plugged = true;
    ++changes_;
  }
  void step(int device) override { ++slot(device)->steps; }
  FaultPlan& faults(int device) override { return slot(device)->model.faults(); }
  std::vector<std::string> requests(int device) const override { return slot(device)->model.log(); }

  std::vector<usb::DeviceInfo> list(std::span<const std::pair<std::uint16_t, std::uint16_t>> ids) override {
    std::vector<usb::DeviceInfo> out;
    for (const auto& s : all()) {
      if (const auto back = s->back_at.load(); !s->plugged && back != 0 && clock_->now().time_since_epoch().count() >= back) {
        s->back_at = 0;
        plug(s->number);
      }
      if (s->plugged && std::find(ids.begin(), ids.end(), kDeviceIds[0]) != ids.end()) out.push_back(info_of(*s));
    }
    return out;
  }
  std::unique_ptr<usb::Device> open(const usb::DeviceInfo& info) override {
    for (const auto& s : all())
      if (s->plugged && s->address == info.address && s->number + 1 == info.bus)
        return std::make_unique<EmulatedDevice>(s, info, clock_, absences_, [this](Slot&) { ++changes_; });
    throw usb::Error(usb::Fault::no_device, "Kinect v2 " + info.serial + " is not on the bus any more");
  }
  std::uint64_t changes() const override { return changes_; }

 private:
  static usb::DeviceInfo info_of(const Slot& s) {
    return {.vendor = kDeviceIds[0].first,
            .product = kDeviceIds[0].second,
            .speed = s.model.settings().speed,
            .bus = s.number + 1,
            .address = s.address,
            .path = std::to_string(s.number + 1) + "-1",
            .serial = s.model.settings().serial};
  }
  std::vector<std::shared_ptr<Slot>> all() const {
    const std::lock_guard lock(mutex_);
    return slots_;
  }
  std::shared_ptr<Slot> slot(int device) const {
    const std::lock_guard lock(mutex_);
    return slots_.at(static_cast<std::size_t>(device));
  }

  const std::shared_ptr<hal::Clock> clock_;
  const Absences absences_;
  mutable std::mutex mutex_;
  std::vector<std::shared_ptr<Slot>> slots_;
  std::atomic<std::uint64_t> changes_{0};
};

}  // namespace

std::shared_ptr<EmulatedBus> make_emulated_bus(std::shared_ptr<hal::Clock> clock, Absences absences) {
  return std::make_shared<Box>(std::move(clock), absences);
}

}  // namespace booth::drivers::kinect2::emulator
