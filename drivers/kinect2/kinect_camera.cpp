// Hand-over between the stream's thread and the reader's.
#include "drivers/kinect2/kinect_camera.hpp"

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>

#include "drivers/kinect2/colour_parser.hpp"
#include "drivers/kinect2/device_keeper.hpp"
#include "drivers/kinect2/device_time.hpp"
#include "drivers/kinect2/infrared_parser.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

using namespace std::chrono_literals;

/// A reader that waits for long still looks so often whether the stream stalls.
constexpr hal::Nanoseconds kLook = 100ms;

/// A frame between the two threads. All of its memory is taken at construction.
struct Assembled {
  std::vector<std::byte> images = std::vector<std::byte>(kFrameBytes);
  std::uint64_t sequence = 0;
  hal::MonotonicTime captured{}, received{};
};

class KinectCamera final : public hal::DepthCamera, private usb::StreamSink {
 public:
  KinectCamera(KinectShared shared, KinectSettings settings)
      : clock_(shared.clock),
        make_(shared.decoder),
        settings_(std::move(settings)),
        keeper_(std::move(shared), settings_),
        infrared_([this](const RawFrame& frame) { on_frame(frame); }) {
    const Calibration calibration = keeper_.learn_calibration();
    decoder_ = make_ ? make_(calibration.depth, calibration.phase, settings_.decoder) : make_decoder(calibration.depth, calibration.phase, settings_.decoder);
    description_ = {.name = settings_.name,
                    .serial = settings_.serial,
                    .intrinsics = unmirrored_intrinsics(calibration.depth),
                    .camera_to_world = settings_.camera_to_world,
                    .depth_scale = 0.001,
                    .depth_gain = settings_.depth_gain,
                    .depth_offset = settings_.depth_offset,
                    .nominal_rate = settings_.nominal_rate};
  }
  ~KinectCamera() override { stop(); }

  const hal::CameraDescription& description() const override { return description_; }
  void start() override;
  void stop() noexcept override;
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override;
  hal::CameraCounters counters() const override;
  hal::DecodeStatus decoding() const override;
  std::string last_error() const override {
    const std::lock_guard lock(mutex_);
    return error_;
  }

 private:
  void begin();
  void on_packet(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived) override { infrared_.push(status, data, arrived); }
  void on_end(usb::Status reason) override;
  void on_frame(const RawFrame& frame);
  hal::ReadStatus without_frame();
  hal::ReadStatus lose(Trouble trouble, std::string sentence);

  /// Colour is received and checked, so that its faults are counted; its pictures go nowhere yet.
  class ColourSink final : public usb::StreamSink {
   public:
    void on_packet(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived) override { parser_.push(status, data, arrived); }
    void on_end(usb::Status) override {}
    void reset() { parser_.reset(); }

   private:
    ColourParser parser_{[](const ColourFrame&) {}};
  };

  const std::shared_ptr<hal::Clock> clock_;
  const DecoderMaker make_;
  const KinectSettings settings_;
  hal::CameraDescription description_;
  std::unique_ptr<Decoder> decoder_;

  std::mutex device_mutex_;  ///< held while the device is started or stopped
  DeviceKeeper keeper_;
  ColourSink colour_;
  bool started_before_ = false;

  // The stream's thread only, and start() while there is none.
  InfraredParser infrared_;
  DeviceTime device_time_;
  std::optional<std::uint32_t> last_sequence_;
  std::uint64_t sequence_ = 0;  ///< of the next frame, unless the device's own numbers leave a gap

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

void KinectCamera::begin() {
  keeper_.stop();  // nothing streams while what the stream's thread uses is set up
  infrared_.reset();
  device_time_.reset();
  last_sequence_.reset();
  colour_.reset();
  const std::lock_guard lock(mutex_);
  full_ = false;
  ended_.reset();
  error_.clear();
  last_frame_ = clock_->now();
  streaming_ = true;
}

void KinectCamera::start() {
  const std::lock_guard device_lock(device_mutex_);
  std::optional<Trouble> trouble;
  std::uint64_t good_frames = 0;
  {
    const std::lock_guard lock(mutex_);
    if (streaming_ && !ended_ && !trouble_) return;
    trouble = std::exchange(trouble_, std::nullopt);
    good_frames = std::exchange(good_frames_, 0);
  }
  begin();
  try {
    keeper_.start(trouble, good_frames, *this, settings_.colour ? &colour_ : nullptr);
  } catch (const Setback& e) {
    const std::lock_guard lock(mutex_);
    streaming_ = false;
    trouble_ = e.trouble();
    error_ = e.what();
    throw;
  }
  const std::lock_guard lock(mutex_);
  last_frame_ = clock_->now();
  counters_.restarts += started_before_;
  started_before_ = true;
}

void KinectCamera::stop() noexcept {
  const auto wake = [this] {
    {
      const std::lock_guard lock(mutex_);
      streaming_ = false;
    }
    changed_.notify_all();
  };
  keeper_.cancel();
  wake();
  const std::lock_guard device_lock(device_mutex_);
  wake();  // a start() may have come in between
  keeper_.stop();
}

void KinectCamera::on_end(usb::Status reason) {
  {
    const std::lock_guard lock(mutex_);
    ended_ = reason;
  }
  changed_.notify_all();
}

void KinectCamera::on_frame(const RawFrame& frame) {
  const std::uint32_t step = last_sequence_ ? frame.sequence - *last_sequence_ : 1;
  // Gaps are lost frames. A device that starts to count anew (or lies) must not send our numbers backwards or far ahead.
  if (step > 1 && step < InfraredParser::kCountsAnew) sequence_ += step - 1;
  last_sequence_ = frame.sequence;
  const auto captured = device_time_.to_host(frame.timestamp, frame.arrived);
  {
    const std::lock_guard lock(mutex_);
    counters_.dropped += full_;
    std::memcpy(pending_->images.data(), frame.images.data(), kFrameBytes);
    pending_->sequence = sequence_++;
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

/// What a reader finds who has waited in vain; `mutex_` is held.
hal::ReadStatus KinectCamera::without_frame() {
  if (!ended_ && clock_->now() - last_frame_ < settings_.patience.stall) return hal::ReadStatus::timeout;  // before anything is allocated
  const std::string name = "Kinect v2 " + settings_.serial;
  if (ended_ == usb::Status::no_device) return lose(Trouble::vanished, name + " left the bus: check its cable and its mains adaptor");
  if (ended_) return lose(Trouble::failed, name + ": its infrared stream broke off, too few transfers could be submitted");
  return lose(Trouble::stalled, name + " streams no complete frame");
}

hal::ReadStatus KinectCamera::read(hal::DepthFrame& slot, hal::Nanoseconds timeout) {
  {
    std::unique_lock lock(mutex_);
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (!full_) {
      if (!streaming_) return hal::ReadStatus::ended;
      const auto left = end - std::chrono::steady_clock::now();
      const bool woken = changed_.wait_for(lock, std::clamp<hal::Nanoseconds>(left, 0ns, kLook), [this] { return full_ || ended_ || !streaming_; });
      if (woken && (!ended_ || !streaming_)) continue;  // a stream that ended because of stop() is not lost
      if (full_) break;
      const auto status = without_frame();
      if (status != hal::ReadStatus::timeout || std::chrono::steady_clock::now() >= end) return status;
    }
    if (!streaming_) return hal::ReadStatus::ended;
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

hal::DecodeStatus KinectCamera::decoding() const {
  const gpu::DeviceReport r = decoder_->report();
  if (!r.wanted) return {};
  return {.name = r.name, .problem = r.problem, .losses = r.losses, .changes = r.changes};
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
