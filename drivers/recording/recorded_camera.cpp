// Loads a frame ahead of its time, waits for it, hands it over.
#include "drivers/recording/recorded_camera.hpp"

#include <algorithm>

namespace booth::drivers {

double rate_of(const std::vector<hal::UtcTime>& times) {
  if (times.size() < 2) return 30;
  std::vector<hal::Nanoseconds> gaps;
  for (std::size_t i = 1; i < times.size(); ++i) gaps.push_back(times[i] - times[i - 1]);
  const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  return 1 / hal::seconds(*middle);
}

RecordedCamera::RecordedCamera(RecordedCameraData data, int index, std::shared_ptr<Timeline> timeline, hal::UtcTime zero)
    : description_(std::move(data.description)),
      frames_(std::move(data.frames)),
      index_(index),
      timeline_(std::move(timeline)),
      zero_(zero),
      depth_(static_cast<std::size_t>(description_.intrinsics.width) * static_cast<std::size_t>(description_.intrinsics.height)) {
  go_to(0);
}

void RecordedCamera::start() {
  if (streaming_.exchange(true)) return;
  if (started_before_.exchange(true)) ++restarts_;
  resumed_ = true;
  timeline_->enter(index_);
}

void RecordedCamera::stop() noexcept {
  if (streaming_.exchange(false)) timeline_->leave(index_);
}

void RecordedCamera::go_to(std::size_t i) {
  next_ = i;
  loaded_ = false;
  const bool finished = i >= frames_->times().size();
  timeline_->advance(index_, finished ? hal::Nanoseconds{} : at(i), finished);
}

void RecordedCamera::skip_what_was_missed() {
  const auto now = timeline_->clock().now();
  const auto due = [&](std::size_t i) { return timeline_->origin() + at(i); };
  const std::size_t count = frames_->times().size();
  std::size_t i = next_;
  // Frames of before the start were not missed: nobody was looking.
  if (resumed_.exchange(false))
    while (i < count && due(i) < now - hal::from_seconds(0.5 / description_.nominal_rate)) ++i;
  while (i + 1 < count && due(i + 1) <= now) {
    ++i;
    ++dropped_;
  }
  if (i != next_) go_to(i);
}

hal::ReadStatus RecordedCamera::read(hal::DepthFrame& slot, hal::Nanoseconds timeout) {
  if (!streaming_) return hal::ReadStatus::ended;
  if (timeline_->pace() == Pace::own) skip_what_was_missed();
  // The picture is decoded before it is due, so that decoding adds nothing to the latency.
  while (!loaded_ && next_ < frames_->times().size()) {
    switch (frames_->load(next_, depth_)) {
      case Load::ok:
        loaded_ = true;
        continue;
      case Load::missing:
        ++dropped_;
        break;
      case Load::broken:
        ++corrupt_;
        break;
    }
    go_to(next_ + 1);
  }
  if (!loaded_) return hal::ReadStatus::ended;
  switch (timeline_->wait(index_, at(next_), {}, timeout)) {
    case Timeline::Wait::stopped:
      return hal::ReadStatus::ended;
    case Timeline::Wait::timeout:
      return hal::ReadStatus::timeout;
    case Timeline::Wait::due:
      break;
  }
  if (slot.depth.size() != depth_.size()) slot.depth.resize(depth_.size());
  slot.depth.swap(depth_);
  slot.camera = static_cast<hal::CameraIndex>(index_);
  slot.sequence = next_;
  slot.captured = timeline_->origin() + at(next_);
  slot.received = timeline_->pace() == Pace::own ? timeline_->clock().now() : slot.captured;
  ++delivered_;
  go_to(next_ + 1);
  return hal::ReadStatus::frame;
}

}  // namespace booth::drivers
