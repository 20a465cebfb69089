// Readers keep the newest frame of each camera; the looking thread takes copies and is as slow as detection is.
#include "daemon/calibrate/live_capture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <thread>

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using fit::calibrate::Rigid;

/// The newest frames of all cameras.
class NewestFrames {
 public:
  explicit NewestFrames(hal::DepthCameras& cameras) : cameras_(cameras), newest_(cameras.size()), fresh_(cameras.size(), false) {
    for (auto& camera : cameras_) camera->start();
    for (std::size_t c = 0; c < cameras_.size(); ++c) readers_.emplace_back([this, c] { read(c); });
  }
  ~NewestFrames() {
    for (auto& camera : cameras_) camera->stop();
    for (auto& reader : readers_) reader.join();
  }
  NewestFrames(const NewestFrames&) = delete;
  NewestFrames& operator=(const NewestFrames&) = delete;

  /// A frame of each camera taken after the last call; those that have none within `timeout` are left out. Throws what a reader met.
  std::vector<hal::DepthFrame> take(hal::Nanoseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [this] { return !problem_.empty() || std::all_of(fresh_.begin(), fresh_.end(), [](bool f) { return f; }); });
    if (!problem_.empty()) throw std::runtime_error(problem_);
    std::vector<hal::DepthFrame> out;
    for (std::size_t c = 0; c < newest_.size(); ++c)
      if (fresh_[c]) out.push_back(newest_[c]), fresh_[c] = false;
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
      const std::lock_guard lock(mutex_);
      if (status == hal::ReadStatus::lost) {
        const std::string why = cameras_[c]->last_error();
        problem_ = why.empty() ? cameras_[c]->description().name + " was lost: check its cable" : why;
        changed_.notify_all();
        return;
      }
      slot.camera = static_cast<hal::CameraIndex>(c);
      newest_[c] = slot;
      fresh_[c] = true;
      changed_.notify_all();
    }
  }

  hal::DepthCameras& cameras_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<hal::DepthFrame> newest_;
  std::vector<bool> fresh_;
  std::string problem_;
  std::vector<std::thread> readers_;
};

/// By where the cameras should stand: print upwards, low. The calibration itself looks again, by the measured floor.
bool lies_on_floor(const FoundBoards& found, const std::vector<hal::CameraDescription>& cameras) {
  for (const auto& s : found.boards) {
    const Rigid board = rigid_of(cameras[static_cast<std::size_t>(s.sighting.camera)].camera_to_world) * s.pose.camera_from_board;
    if (board.rotation(2, 2) < 0.9 || std::abs(board.translation.z()) > 0.4) return false;
  }
  return !found.boards.empty();
}

void check_infrared(const std::vector<hal::DepthFrame>& frames, const std::vector<hal::CameraDescription>& cameras) {
  for (const auto& f : frames)
    if (f.infrared.empty() || std::all_of(f.infrared.begin(), f.infrared.end(), [](std::uint16_t v) { return v == 0; }))
      throw std::runtime_error(cameras[static_cast<std::size_t>(hal::to_int(f.camera))].name +
                               " delivers no infrared picture: the board can be found in those of Kinect v2 sensors and of simulated boards only");
}

}  // namespace

ViewCollector capture_live(hal::DepthCameras& cameras, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks) {
  NewestFrames newest(cameras);
  std::vector<hal::CameraDescription> descriptions;
  for (const auto& c : cameras) descriptions.push_back(c->description());
  ViewCollector collector(descriptions, settings.board, true, settings.needs);
  CaptureFlow flow(settings.rules);
  bool floor = false, enough = false;
  const hal::MonotonicTime begin = clock.now();
  hal::MonotonicTime last_view = begin;
  while (!hooks.stop()) {
    const auto frames = newest.take(2s);
    if (hal::seconds(clock.now() - last_view) > settings.give_up_seconds)
      throw std::runtime_error(
          fmt::format("no new view of the board for {:.0f} s: the calibration was given up, nothing was changed", settings.give_up_seconds));
    if (frames.empty()) continue;
    check_infrared(frames, descriptions);
    std::vector<ViewPicture> pictures;
    for (const auto& f : frames) {
      const auto& k = descriptions[static_cast<std::size_t>(hal::to_int(f.camera))].intrinsics;
      pictures.push_back({hal::to_int(f.camera), {k.width, k.height, f.infrared}, {k.width, k.height, f.depth}});
    }
    const FoundBoards found = collector.find(pictures);
    BoardLook look{hal::seconds(clock.now() - begin), {}, found.mirrored + found.foreign > 0};
    CaptureNews news;
    for (const auto& b : found.boards) {
      look.seen.push_back({b.sighting.camera, b.pose.camera_from_board});
      news.seen.push_back(descriptions[static_cast<std::size_t>(b.sighting.camera)].name);
    }
    news.cue = flow.look(look);
    if (news.cue == CaptureCue::captured) {
      if (hooks.view) hooks.view(collector.input().views, frames);
      enough = collector.add(pictures, found).progress.enough;
      floor = floor || lies_on_floor(found, descriptions);
      last_view = clock.now();
    }
    news.taken = flow.taken();
    news.next = !enough ? collector.next_place() : floor ? "" : "lay the board on the floor in the middle of the stage, print upwards, its arrow to the front";
    if (enough && floor) flow.finish(), news.cue = CaptureCue::done;
    hooks.news(news);
    if (news.cue == CaptureCue::done) break;
  }
  return collector;
}

}  // namespace booth::daemon
