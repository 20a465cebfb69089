// Readers keep the newest frame of each camera; the looking thread takes copies and is as slow as detection is.
#include "daemon/calibrate/live_capture.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>
#include <thread>

#include "daemon/calibrate/newest_frames.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using fit::calibrate::Calibration;
using fit::calibrate::Refusal;

/// Cameras that nobody else reads.
class OwnCameras final : public FrameFeed {
 public:
  explicit OwnCameras(hal::DepthCameras& cameras) : cameras_(cameras), newest_(cameras.size()) {
    for (auto& camera : cameras_) camera->start();
    for (std::size_t c = 0; c < cameras_.size(); ++c) readers_.emplace_back([this, c] { read(c); });
  }
  ~OwnCameras() override {
    for (auto& camera : cameras_) camera->stop();
    for (auto& reader : readers_) reader.join();
  }
  OwnCameras(const OwnCameras&) = delete;
  OwnCameras& operator=(const OwnCameras&) = delete;

  std::vector<hal::CameraDescription> cameras() const override {
    std::vector<hal::CameraDescription> out;
    for (const auto& c : cameras_) out.push_back(c->description());
    return out;
  }
  std::vector<hal::DepthFrame> take(hal::Nanoseconds timeout) override { return newest_.take(timeout); }
  std::vector<std::string> silent() const override {
    std::vector<std::string> out;
    for (const std::size_t c : newest_.silent()) out.push_back(cameras_[c]->description().name);
    return out;
  }

 private:
  void read(std::size_t c) {
    const auto& k = cameras_[c]->description().intrinsics;
    hal::DepthFrame slot;
    const auto size = static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height);
    for (;;) {
      slot.infrared.assign(size, 0);
      const hal::ReadStatus status = cameras_[c]->read(slot, 200ms);
      if (status == hal::ReadStatus::ended) return;
      if (status == hal::ReadStatus::timeout) continue;
      if (status == hal::ReadStatus::lost) {
        const std::string why = cameras_[c]->last_error();
        newest_.fail(why.empty() ? cameras_[c]->description().name + " was lost: check its cable" : why);
        return;
      }
      slot.camera = static_cast<hal::CameraIndex>(c);
      newest_.put(slot);
    }
  }

  hal::DepthCameras& cameras_;
  NewestFrames newest_;
  std::vector<std::thread> readers_;
};

void check_infrared(const std::vector<hal::DepthFrame>& frames, const std::vector<hal::CameraDescription>& cameras) {
  for (const auto& f : frames)
    if (f.infrared.empty() || std::all_of(f.infrared.begin(), f.infrared.end(), [](std::uint16_t v) { return v == 0; }))
      throw std::runtime_error(cameras[static_cast<std::size_t>(hal::to_int(f.camera))].name +
                               " delivers no infrared picture: the board can be found in those of Kinect v2 sensors and of simulated boards only");
}

/// What the views make, and whether more of them could make it better.
struct Trial {
  bool good = false, hopeless = false;
  bool origin = false;  ///< a board lay on the floor
  std::string why;
};

Trial try_views(const ViewCollector& collector) {
  const Calibration c = fit::calibrate::calibrate(collector.input());
  // Uncertain cameras gain from views; a wrong board, a camera that was moved or exchanged does not.
  const bool wants_views = c.refusal == Refusal::inaccurate || c.refusal == Refusal::too_few_views;
  return {c.accepted(), !c.accepted() && !wants_views, c.accepted() && c.origin_from_board, c.sentence};
}

/// The state of one capture.
class Capture {
 public:
  Capture(FrameFeed& feed, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks)
      : feed_(feed),
        clock_(clock),
        settings_(settings),
        hooks_(hooks),
        cameras_(feed.cameras()),
        collector_(cameras_, settings.board, true, settings.needs),
        flow_(settings.rules),
        begin_(clock.now()),
        last_view_(begin_),
        good_since_(begin_) {}

  ViewCollector run() {
    while (!hooks_.stop() && !look()) {
    }
    return std::move(collector_);
  }

 private:
  bool complete() const { return (trial_.good && trial_.origin) || trial_.hopeless || (enough_ && !trial_.good && flow_.taken() >= settings_.most_views); }

  /// True at the end.
  bool look() {
    const auto frames = feed_.take(2s);
    if (!trial_.good && hal::seconds(clock_.now() - last_view_) > settings_.give_up_seconds) give_up();
    if (trial_.good && hal::seconds(clock_.now() - good_since_) > settings_.floor_seconds) return end();
    if (frames.empty()) return tell({.cue = CaptureCue::search, .taken = flow_.taken(), .seen = {}, .next = next_place()});
    check_infrared(frames, cameras_);
    std::vector<ViewPicture> pictures;
    for (const auto& f : frames) {
      const auto& k = cameras_[static_cast<std::size_t>(hal::to_int(f.camera))].intrinsics;
      pictures.push_back({hal::to_int(f.camera), {k.width, k.height, f.infrared}, {k.width, k.height, f.depth}});
    }
    FoundBoards found = collector_.find(pictures);
    if (enough_ && !trial_.origin && found.boards.size() < pictures.size()) found = collector_.find_on_floor(pictures, std::move(found));
    BoardLook look{hal::seconds(clock_.now() - begin_), {}, found.mirrored + found.foreign > 0};
    CaptureNews news;
    for (const auto& b : found.boards) {
      look.seen.push_back({b.sighting.camera, b.pose.camera_from_board});
      news.seen.push_back(cameras_[static_cast<std::size_t>(b.sighting.camera)].name);
    }
    news.cue = flow_.look(look);
    if (news.cue == CaptureCue::captured) take(frames, pictures, std::move(found));
    if (complete()) return end();
    news.taken = flow_.taken();
    news.next = next_place();
    return tell(news);
  }

  void take(const std::vector<hal::DepthFrame>& frames, const std::vector<ViewPicture>& pictures, FoundBoards found) {
    if (hooks_.view) hooks_.view(collector_.input().views, frames);
    enough_ = collector_.add(pictures, std::move(found)).progress.enough;
    last_view_ = clock_.now();
    if (!enough_) return;
    const bool was = trial_.good;
    trial_ = try_views(collector_);
    if (!was) good_since_ = clock_.now();
  }

  std::string next_place() const {
    const auto silent = feed_.silent();
    if (!silent.empty()) return fmt::format("no pictures come from {}: look at its plug and cable", fmt::join(silent, ", "));
    if (!enough_) return collector_.next_place();
    if (!trial_.good) return "more views, please: " + trial_.why;
    return trial_.origin ? "" : "lay the board on the floor in the middle of the stage, print upwards, its arrow to the front";
  }

  bool tell(const CaptureNews& news) const {
    if (hooks_.news) hooks_.news(news);
    return false;
  }

  bool end() {
    flow_.finish();
    tell({.cue = CaptureCue::done, .taken = flow_.taken(), .seen = {}, .next = {}});
    return true;
  }

  [[noreturn]] void give_up() const {
    const auto silent = feed_.silent();
    throw std::runtime_error(fmt::format("no new view of the board for {:.0f} s{}: the calibration was given up, nothing was changed",
                                         settings_.give_up_seconds,
                                         silent.empty() ? "" : fmt::format(", and no pictures came from {}", fmt::join(silent, ", "))));
  }

  FrameFeed& feed_;
  hal::Clock& clock_;
  const LiveCaptureSettings& settings_;
  const LiveCaptureHooks& hooks_;
  const std::vector<hal::CameraDescription> cameras_;
  ViewCollector collector_;
  CaptureFlow flow_;
  Trial trial_;
  bool enough_ = false;
  const hal::MonotonicTime begin_;
  hal::MonotonicTime last_view_, good_since_;  ///< when the last view was taken; since when the views are enough
};

}  // namespace

ViewCollector capture_live(FrameFeed& feed, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks) {
  return Capture(feed, clock, settings, hooks).run();
}

ViewCollector capture_live(hal::DepthCameras& cameras, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks) {
  OwnCameras own(cameras);
  return capture_live(own, clock, settings, hooks);
}

}  // namespace booth::daemon
