// A booth of four rendered cameras with a person in it who shows the calibration board and does what he is told.
#pragma once

#include <functional>
#include <future>

#include "daemon/calibrate/live_capture.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "tests/daemon/calibrate/rendered_booth.hpp"

namespace booth::tests {

/// Moves on after each view and where a place is no good, and lays the board down when he is asked to. A look takes a second of the clock.
class CapturePerson final : public daemon::FrameFeed {
 public:
  CapturePerson(double side, std::uint64_t seed, int views) : booth_(side, seed, views), views_(views) {}

  std::vector<hal::CameraDescription> cameras() const override { return booth_.planned; }
  std::vector<hal::DepthFrame> take(hal::Nanoseconds) override {
    if (listen) hear(listen());
    clock.advance(std::chrono::seconds(1));
    ++looks;
    drivers::ShownBoard shown;
    shown.booth_from_board = booth_.places[static_cast<std::size_t>(lies_ ? views_ : at_ % views_)];
    std::vector<std::future<hal::DepthFrame>> frames;
    for (auto& camera : booth_.camera) frames.push_back(std::async(std::launch::async, [&] { return camera.look(shown, static_cast<std::uint64_t>(looks)); }));
    std::vector<hal::DepthFrame> out;
    for (auto& f : frames) out.push_back(f.get());
    std::erase_if(out, [&](const auto& f) { return hal::to_int(f.camera) == silent_camera; });
    return out;
  }
  std::vector<std::string> silent() const override {
    return silent_camera >= 0 ? std::vector{booth_.planned[static_cast<std::size_t>(silent_camera)].name} : std::vector<std::string>{};
  }

  void hear(const daemon::CaptureNews& news) {
    said.push_back(news.next);
    lies_ = lays_it_down && news.next.starts_with("lay the board on the floor");
    if (news.cue != daemon::CaptureCue::hold_still) ++at_;
  }
  const RenderedBooth& booth() const { return booth_; }

  drivers::ManualClock clock;
  std::function<daemon::CaptureNews()> listen;  ///< asked before each look; may be empty
  bool lays_it_down = true;
  int silent_camera = -1, looks = 0;
  std::vector<std::string> said;

 private:
  RenderedBooth booth_;
  const int views_;
  int at_ = 0;
  bool lies_ = false;
};

/// How far cameras are from the truth at worst: metres and radians, in the booth, or, with `relative`, against the first camera.
struct Misplaced {
  double position = 0, angle = 0;
};
inline Misplaced misplaced(const std::vector<fit::calibrate::CalibratedCamera>& cameras, const RenderedBooth& booth, bool relative) {
  Misplaced out;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    auto real = daemon::rigid_of(booth.real[i].camera_to_world), found = cameras[i].booth_from_camera;
    if (relative) real = daemon::rigid_of(booth.real[0].camera_to_world).inverse() * real, found = cameras[0].booth_from_camera.inverse() * found;
    out.position = std::max(out.position, (found.translation - real.translation).norm());
    out.angle = std::max(out.angle, fit::calibrate::angle_between(found.rotation, real.rotation));
  }
  return out;
}

}  // namespace booth::tests
