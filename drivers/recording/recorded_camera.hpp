// A recorded camera as a HAL device: the pace, the losses and the counters are the same for every layout.
#pragma once

#include <atomic>
#include <memory>

#include "drivers/pacing/timeline.hpp"
#include "drivers/recording/frame_store.hpp"
#include "hal/depth_camera.hpp"

namespace booth::drivers {

/// A frame that is missing or broken is counted (dropped, corrupt) and left out. Streaming goes on where it was stopped.
class RecordedCamera final : public hal::DepthCamera {
 public:
  /// `zero` is the wall time of source time zero, the same for all cameras of a recording.
  RecordedCamera(RecordedCameraData data, int index, std::shared_ptr<Timeline> timeline, hal::UtcTime zero);

  const hal::CameraDescription& description() const override { return description_; }
  void start() override;
  void stop() noexcept override;
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override;
  hal::CameraCounters counters() const override { return {delivered_, dropped_, corrupt_, restarts_}; }
  std::string last_error() const override { return {}; }

 private:
  hal::Nanoseconds at(std::size_t i) const { return frames_->times()[i] - zero_; }
  void skip_what_was_missed();
  void go_to(std::size_t i);

  const hal::CameraDescription description_;
  const std::unique_ptr<FrameStore> frames_;
  const int index_;
  const std::shared_ptr<Timeline> timeline_;
  const hal::UtcTime zero_;
  std::vector<std::uint16_t> depth_;
  std::size_t next_ = 0;
  bool loaded_ = false;
  std::atomic<bool> streaming_{false}, resumed_{false}, started_before_{false};
  std::atomic<std::uint64_t> delivered_{0}, dropped_{0}, corrupt_{0}, restarts_{0};
};

}  // namespace booth::drivers
