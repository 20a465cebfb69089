// A picture is rendered when it is asked for, so a slow machine sees fewer and never old ones.
#include "drivers/synthetic/board_source.hpp"

#include <algorithm>
#include <stdexcept>

namespace booth::drivers {
namespace {

class InstallerCamera final : public hal::DepthCamera {
 public:
  InstallerCamera(const hal::CameraDescription& real, hal::CameraDescription told, int index, const BoardViewSettings& settings, double rate,
                  std::shared_ptr<const SimulatedInstaller> installer, std::shared_ptr<hal::Clock> clock)
      : told_(std::move(told)),
        camera_(real, index, settings),
        period_(hal::from_seconds(1 / rate)),
        installer_(std::move(installer)),
        clock_(std::move(clock)) {}

  const hal::CameraDescription& description() const override { return told_; }
  void start() override {
    if (!streaming_.exchange(true)) due_ = clock_->now() + period_;
  }
  void stop() noexcept override { streaming_ = false; }

  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    if (!streaming_) return hal::ReadStatus::ended;
    const hal::MonotonicTime end = clock_->now() + timeout;
    clock_->sleep_until(std::min(due_, end));
    if (!streaming_) return hal::ReadStatus::ended;
    if (clock_->now() < due_) return hal::ReadStatus::timeout;
    const bool infrared = !slot.infrared.empty();
    hal::DepthFrame frame = camera_.look(installer_->shows(), next_);
    slot.camera = frame.camera;
    slot.sequence = next_++;
    slot.captured = slot.received = clock_->now();
    slot.depth = std::move(frame.depth);
    if (infrared) slot.infrared = std::move(frame.infrared);
    due_ = clock_->now() + period_;  // rendering takes its time, and leaves the machine some for looking
    ++delivered_;
    return hal::ReadStatus::frame;
  }

  hal::CameraCounters counters() const override { return {delivered_, 0, 0, 0}; }
  std::string last_error() const override { return {}; }

 private:
  const hal::CameraDescription told_;
  BoardCamera camera_;
  const hal::Nanoseconds period_;
  const std::shared_ptr<const SimulatedInstaller> installer_;
  const std::shared_ptr<hal::Clock> clock_;
  hal::MonotonicTime due_{};
  std::uint64_t next_ = 0;
  std::atomic<std::uint64_t> delivered_{0};
  std::atomic<bool> streaming_{false};
};

}  // namespace

std::optional<ShownBoard> SimulatedInstaller::shows() const {
  if (places_.empty()) return std::nullopt;
  ShownBoard shown;
  shown.board = board_;
  shown.booth_from_board = places_[at_ % places_.size()];
  return shown;
}

hal::DepthCameras make_board_cameras(const std::vector<hal::CameraDescription>& real, const std::vector<hal::CameraDescription>& told,
                                     const std::vector<BoardViewSettings>& settings, double rate, const std::shared_ptr<const SimulatedInstaller>& installer,
                                     const std::shared_ptr<hal::Clock>& clock) {
  if (real.size() != told.size() || real.size() != settings.size() || !(rate > 0))
    throw std::invalid_argument("simulated cameras and their settings differ in number");
  hal::DepthCameras out;
  for (std::size_t i = 0; i < real.size(); ++i)
    out.push_back(std::make_unique<InstallerCamera>(real[i], told[i], static_cast<int>(i), settings[i], rate, installer, clock));
  return out;
}

}  // namespace booth::drivers
