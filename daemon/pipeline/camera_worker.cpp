// Reading, restarting with back-off, and the counters that status shows.
#include "daemon/pipeline/camera_worker.hpp"

#include <pthread.h>

#include <algorithm>
#include <exception>

namespace booth::daemon {

using namespace std::chrono_literals;

const char* to_string(CameraState s) {
  switch (s) {
    case CameraState::starting:
      return "starting";
    case CameraState::running:
      return "running";
    case CameraState::lost:
      return "lost";
    case CameraState::ended:
      return "ended";
  }
  return "?";
}

CameraWorker::CameraWorker(hal::DepthCamera& camera, hal::CameraIndex index, hal::Clock& clock, Wakeup& bell)
    : camera_(camera), index_(index), clock_(clock), bell_(bell), slots_(kSlots) {
  const auto& intrinsics = camera.description().intrinsics;
  const auto pixels = static_cast<std::size_t>(intrinsics.width) * static_cast<std::size_t>(intrinsics.height);
  for (auto& slot : slots_) slot.depth.resize(pixels);
  spare_.depth.resize(pixels);
  for (int i = 0; i < static_cast<int>(kSlots); ++i) (void)free_.push(i);
  thread_ = std::thread([this] { run(); });
}

CameraWorker::~CameraWorker() {
  stop_ = true;
  camera_.stop();
  thread_.join();
}

void CameraWorker::set_problem(const std::string& text) {
  const std::lock_guard lock(problem_mutex_);
  problem_ = text;
}

void CameraWorker::pause(hal::Nanoseconds duration) {
  // Wall time in small steps: a restart is about the real device, and the end of the daemon must not wait for it.
  for (auto waited = 0ns; waited < duration && !stop_; waited += 20ms) {
    std::this_thread::sleep_for(20ms);
    progress_.turn();
  }
}

bool CameraWorker::start_camera() {
  const PatientProgress::Busy busy(progress_);
  try {
    camera_.start();
    return true;  // what was wrong is shown until a frame proves that it is over
  } catch (const std::exception& e) {
    set_problem(e.what());
    return false;
  }
}

void CameraWorker::stop_camera() {
  const PatientProgress::Busy busy(progress_);
  camera_.stop();
}

void CameraWorker::note_frame(hal::MonotonicTime now) {
  if (window_frames_ == 0) window_start_ = now;
  if (++window_frames_ > 15 && now > window_start_) {
    fps_.store(static_cast<float>((window_frames_ - 1) / hal::seconds(now - window_start_)), std::memory_order_relaxed);
    window_frames_ = 1;
    window_start_ = now;
  }
}

void CameraWorker::run() {
  char name[16] = "frame-cam-0";
  name[10] = static_cast<char>('0' + hal::to_int(index_) % 10);
  ::pthread_setname_np(::pthread_self(), name);
  constexpr auto kFirstPause = 500ms, kLongestPause = 10000ms;
  constexpr auto kReadTimeout = 100ms;
  // Two seconds without a frame, or ten frames of a slow camera: the device is taken for stalled.
  const int silent_reads = std::max(20, static_cast<int>(100 / std::max(0.1, camera_.description().nominal_rate)));
  hal::Nanoseconds back_off = kFirstPause;
  int slot = -1;
  bool troubled = false;
  while (!stop_) {
    if (!start_camera()) {
      troubled = true;
      state_.store(CameraState::lost, std::memory_order_release);
      pause(back_off);
      back_off = std::min<hal::Nanoseconds>(2 * back_off, kLongestPause);
      continue;
    }
    int silent = 0;
    bool ended = false;
    while (!stop_) {
      progress_.turn();
      if (slot < 0 && !free_.pop(slot)) slot = -1;
      hal::DepthFrame& target = slot < 0 ? spare_ : slots_[static_cast<std::size_t>(slot)];
      const hal::ReadStatus status = camera_.read(target, kReadTimeout);
      if (status == hal::ReadStatus::frame) {
        silent = 0;
        back_off = kFirstPause;
        if (troubled) set_problem("");
        troubled = false;
        state_.store(CameraState::running, std::memory_order_release);
        note_frame(clock_.now());
        if (slot < 0) {
          no_slot_.fetch_add(1, std::memory_order_relaxed);
          continue;
        }
        target.camera = index_;
        (void)ready_.push(slot);
        slot = -1;
        bell_.ring();
      } else if (status == hal::ReadStatus::timeout) {
        if (++silent < silent_reads) continue;
        set_problem("no frame for " + std::to_string(silent_reads / 10) + " seconds");
        break;
      } else if (status == hal::ReadStatus::ended) {
        ended = true;
        break;
      } else {
        set_problem(camera_.last_error());
        break;
      }
    }
    fps_.store(0, std::memory_order_relaxed);
    window_frames_ = 0;
    if (stop_) break;
    if (ended) {
      state_.store(CameraState::ended, std::memory_order_release);
      bell_.ring();
      break;
    }
    state_.store(CameraState::lost, std::memory_order_release);
    troubled = true;
    stop_camera();
    restarts_.fetch_add(1, std::memory_order_relaxed);
    pause(back_off);
    back_off = std::min<hal::Nanoseconds>(2 * back_off, kLongestPause);
  }
  camera_.stop();
}

CameraStatus CameraWorker::status() const {
  CameraStatus out;
  out.name = camera_.description().name;
  out.serial = camera_.description().serial;
  out.state = state();
  out.fps = fps_.load(std::memory_order_relaxed);
  out.counters = camera_.counters();
  out.decoding = camera_.decoding();
  out.no_slot = no_slot_.load(std::memory_order_relaxed);
  out.restarts = restarts_.load(std::memory_order_relaxed);
  const std::lock_guard lock(problem_mutex_);
  out.problem = problem_;
  return out;
}

std::size_t CameraWorker::memory_bytes() const { return (kSlots + 1) * spare_.depth.size() * sizeof(std::uint16_t); }

}  // namespace booth::daemon
