// Hand-over between the stream's thread and the reader's, and the way back after trouble.
#include "drivers/kinect2/kinect_camera.hpp"

#include <atomic>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>

#include "drivers/kinect2/colour_parser.hpp"
#include "drivers/kinect2/device_time.hpp"
#include "drivers/kinect2/infrared_parser.hpp"
#include "drivers/kinect2/kinect_device.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;

/// Shorter than the two seconds after which a reader gives up by itself, so that the ladder learns of each stall.
constexpr auto kStall = 1800ms;
/// A rebooting device is away for about three seconds, some for ten.
constexpr auto kRebootAbsence = 10s;

/// A frame between the two threads. All of its memory is taken at construction.
struct Assembled {
  std::vector<std::byte> images = std::vector<std::byte>(kFrameBytes);
  std::uint64_t sequence = 0;
  hal::MonotonicTime captured{}, received{};
};

class KinectCamera final : public hal::DepthCamera, private usb::StreamSink {
 public:
  KinectCamera(KinectShared shared, KinectSettings settings)
      : shared_(std::move(shared)), settings_(std::move(settings)), infrared_([this](const RawFrame& frame) { on_frame(frame); }) {
    const Calibration calibration = learn_calibration();
    decoder_ = make_decoder(calibration.depth, calibration.phase, settings_.decoder);
    description_ = {.name = settings_.name,
                    .serial = settings_.serial,
                    .intrinsics = unmirrored_intrinsics(calibration.depth),
                    .camera_to_world = settings_.camera_to_world,
                    .depth_scale = 0.001,
                    .nominal_rate = 30.0};
  }
  ~KinectCamera() override { stop(); }

  const hal::CameraDescription& description() const override { return description_; }
  void start() override;
  void stop() noexcept override;
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override;
  hal::CameraCounters counters() const override;
  std::string last_error() const override {
    const std::lock_guard lock(mutex_);
    return error_;
  }

 private:
  Calibration learn_calibration();
  void climb(Trouble trouble);
  void reboot();
  void open();
  void wait_for_gate();
  void begin_stream();
  [[noreturn]] void fail(Trouble trouble, const std::string& sentence);

  void on_packet(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived) override { infrared_.push(status, data, arrived); }
  void on_end(usb::Status reason) override;
  void on_frame(const RawFrame& frame);
  hal::ReadStatus lose(Trouble trouble, std::string sentence);

  /// Colour is received and checked, so that its faults are counted; its pictures go nowhere yet.
  class ColourSink final : public usb::StreamSink {
   public:
    void on_packet(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived) override { parser_.push(status, data, arrived); }
    void on_end(usb::Status) override {}

   private:
    ColourParser parser_{[](const ColourFrame&) {}};
  };

  KinectShared shared_;
  KinectSettings settings_;
  hal::CameraDescription description_;
  std::unique_ptr<Decoder> decoder_;

  // The device and its recovery; one thread at a time.
  std::mutex device_mutex_;
  std::unique_ptr<KinectDevice> device_;
  std::unique_ptr<ColourSink> colour_;
  RecoveryLadder ladder_;
  std::string path_;  ///< the port where the device was last
  bool reset_next_ = true;
  std::optional<hal::MonotonicTime> back_by_;  ///< until then a missing device is rebooting, not gone
  std::atomic<bool> cancel_{false};

  // The stream's thread only, and start() while there is none.
  InfraredParser infrared_;
  DeviceTime device_time_;
  std::optional<std::uint32_t> last_sequence_;
  std::uint64_t sequence_ = 0;

  // Shared by the stream's thread and the reader's.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::unique_ptr<Assembled> pending_ = std::make_unique<Assembled>();
  std::unique_ptr<Assembled> decoding_ = std::make_unique<Assembled>();  ///< the reader's alone
  bool full_ = false, streaming_ = false;
  std::optional<usb::Status> ended_;
  std::optional<Trouble> trouble_;
  std::uint64_t good_frames_ = 0;
  hal::MonotonicTime last_frame_{};
  hal::CameraCounters counters_;
  std::string error_;
};

Calibration KinectCamera::learn_calibration() {
  try {
    KinectDevice device(*shared_.bus, settings_.serial, false, cancel_);
    return device.calibration(shared_.cache.get());
  } catch (const std::exception& e) {
    if (shared_.cache)
      if (auto known = shared_.cache->load_latest(settings_.serial)) {
        trouble_ = Trouble::vanished;
        return std::move(*known);
      }
    throw std::runtime_error(std::string(e.what()) + "; its calibration was never read, so boothd cannot start without it");
  }
}

void KinectCamera::fail(Trouble trouble, const std::string& sentence) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  error_ = sentence;
  throw std::runtime_error(sentence);
}

void KinectCamera::wait_for_gate() {
  while (!shared_.gate->enter(shared_.clock->now())) {
    if (cancel_) throw std::runtime_error("Kinect v2 " + settings_.serial + ": stopped while it waited to reset");
    std::this_thread::sleep_for(20ms);
  }
}

void KinectCamera::reboot() {
  try {
    if (!device_) device_ = std::make_unique<KinectDevice>(*shared_.bus, settings_.serial, false, cancel_);
    device_->reboot();
  } catch (const std::exception&) {
    // It may leave before it answers, or not hear at all; either way the next rung decides.
  }
  device_.reset();
  reset_next_ = false;
  back_by_ = shared_.clock->now() + kRebootAbsence;
  fail(Trouble::stalled, "Kinect v2 " + settings_.serial + " was told to reboot; it will be back in a few seconds");
}

void KinectCamera::climb(Trouble trouble) {
  for (Rung rung = ladder_.after(trouble);; rung = ladder_.after(trouble)) {
    switch (rung) {
      case Rung::restart_stream:
        return;
      case Rung::reopen:
      case Rung::ask_for_help:
        device_.reset();
        reset_next_ = true;
        return;
      case Rung::reboot:
        return reboot();
      case Rung::reset_port:
      case Rung::rebind_controller: {
        const auto& tool = rung == Rung::reset_port ? shared_.power.reset_port : shared_.power.rebind_controller;
        device_.reset();
        if (path_.empty() || !tool || !tool(path_)) break;  // not permitted here: the next rung
        reset_next_ = false;
        back_by_ = shared_.clock->now() + kRebootAbsence;
        return;
      }
    }
  }
}

void KinectCamera::open() {
  if (reset_next_) wait_for_gate();
  path_ = find_kinect(*shared_.bus, settings_.serial).path;
  device_ = std::make_unique<KinectDevice>(*shared_.bus, settings_.serial, std::exchange(reset_next_, false), cancel_);
  back_by_.reset();
}

void KinectCamera::begin_stream() {
  infrared_.reset();
  device_time_.reset();
  last_sequence_.reset();
  {
    const std::lock_guard lock(mutex_);
    full_ = false;
    ended_.reset();
    error_.clear();
    last_frame_ = shared_.clock->now();
    streaming_ = true;
  }
  if (settings_.colour) colour_ = std::make_unique<ColourSink>();
  device_->start(settings_.transfers, *this, colour_.get());
}

void KinectCamera::start() {
  const std::lock_guard device_lock(device_mutex_);
  cancel_ = false;
  std::optional<Trouble> trouble;
  {
    const std::lock_guard lock(mutex_);
    if (streaming_ && !ended_) return;
    trouble = std::exchange(trouble_, std::nullopt);
    if (trouble || !device_) counters_.restarts += counters_.delivered > 0;
    for (; good_frames_ > 0; --good_frames_) ladder_.delivered();
  }
  const bool awaited = back_by_ && shared_.clock->now() < *back_by_;
  try {
    if (trouble && !(awaited && !device_)) climb(*trouble);
    if (!device_) open();
    begin_stream();
  } catch (const NotReady& e) {
    fail(Trouble::not_ready, e.what());
  } catch (const usb::Error& e) {
    device_.reset();
    const bool gone = e.fault() == usb::Fault::no_device || e.fault() == usb::Fault::not_found;
    if (gone) reset_next_ = false;
    fail(gone ? Trouble::vanished : Trouble::failed,
         e.what() + std::string(ladder_.tried() > 5 ? "; it has not answered for long: unplug it from USB and mains for ten seconds" : ""));
  } catch (const CommandError& e) {
    fail(Trouble::failed, e.what());
  }
}

void KinectCamera::stop() noexcept {
  cancel_ = true;
  {
    const std::lock_guard lock(mutex_);
    streaming_ = false;
  }
  changed_.notify_all();
  const std::lock_guard device_lock(device_mutex_);
  {
    const std::lock_guard lock(mutex_);
    streaming_ = false;
  }
  if (device_ && !device_->stop()) {
    device_.reset();
    reset_next_ = true;
  }
}

void KinectCamera::on_end(usb::Status reason) {
  {
    const std::lock_guard lock(mutex_);
    ended_ = reason;
  }
  changed_.notify_all();
}

void KinectCamera::on_frame(const RawFrame& frame) {
  const std::uint32_t step = last_sequence_ ? frame.sequence - *last_sequence_ : 0;
  // A device that starts to count anew (or lies) must not send our numbers backwards.
  sequence_ += last_sequence_ && step > 0 && step < 0x8000'0000u ? step : 1;
  last_sequence_ = frame.sequence;
  const auto captured = device_time_.to_host(frame.timestamp, frame.arrived);
  {
    const std::lock_guard lock(mutex_);
    counters_.dropped += full_;
    std::memcpy(pending_->images.data(), frame.images.data(), kFrameBytes);
    pending_->sequence = sequence_;
    pending_->captured = captured;
    pending_->received = frame.arrived;
    full_ = true;
    last_frame_ = frame.arrived;
  }
  changed_.notify_all();
}

hal::ReadStatus KinectCamera::lose(Trouble trouble, std::string sentence) {
  trouble_ = trouble;
  error_ = std::move(sentence);
  return hal::ReadStatus::lost;
}

hal::ReadStatus KinectCamera::read(hal::DepthFrame& slot, hal::Nanoseconds timeout) {
  {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [this] { return full_ || ended_ || !streaming_; });
    if (!streaming_) return hal::ReadStatus::ended;
    if (!full_) {
      const std::string name = "Kinect v2 " + settings_.serial;
      if (ended_ == usb::Status::no_device) return lose(Trouble::vanished, name + " left the bus: check its cable and its mains adaptor");
      if (ended_) return lose(Trouble::failed, name + ": its infrared stream broke off, too few transfers could be submitted");
      if (shared_.clock->now() - last_frame_ < kStall) return hal::ReadStatus::timeout;
      return lose(Trouble::stalled, name + " streams no complete frame");
    }
    std::swap(pending_, decoding_);
    full_ = false;
    ++counters_.delivered;
    ++good_frames_;
  }
  slot.depth.resize(kPixels);
  decoder_->decode(decoding_->images, slot.depth, slot.infrared.size() == kPixels ? std::span<std::uint16_t>(slot.infrared) : std::span<std::uint16_t>());
  slot.camera = settings_.index;
  slot.sequence = decoding_->sequence;
  slot.captured = decoding_->captured;
  slot.received = decoding_->received;
  return hal::ReadStatus::frame;
}

hal::CameraCounters KinectCamera::counters() const {
  const std::lock_guard lock(mutex_);
  hal::CameraCounters out = counters_;
  const auto seen = infrared_.counters();
  out.dropped += seen.lost_frames;
  out.corrupt += seen.incomplete_frames;
  return out;
}

}  // namespace

std::unique_ptr<hal::DepthCamera> make_kinect_camera(KinectShared shared, KinectSettings settings) {
  return std::make_unique<KinectCamera>(std::move(shared), std::move(settings));
}

}  // namespace booth::drivers::kinect2
