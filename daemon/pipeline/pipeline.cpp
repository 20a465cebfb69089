// The two threads behind the cameras: one groups frames, one fits the newest group.
#include "daemon/pipeline/pipeline.hpp"

#include <pthread.h>

#include <algorithm>

namespace booth::daemon {

using namespace std::chrono_literals;

Pipeline::Pipeline(Settings settings, hal::DepthCameras& cameras, hal::Clock& clock, FrameFitter& fitter, FrameSink& sink)
    : settings_(settings), clock_(clock), fitter_(fitter), sink_(sink) {
  settings_.synchroniser.cameras = static_cast<int>(cameras.size());
  // A slow camera (emulated on a small machine) is not silent between two of its frames, and its group may wait longer.
  for (const auto& camera : cameras) {
    const hal::Nanoseconds period = hal::from_seconds(1 / std::max(0.1, camera->description().nominal_rate));
    settings_.synchroniser.silence = std::max(settings_.synchroniser.silence, 3 * period);
    settings_.synchroniser.patience = std::max(settings_.synchroniser.patience, period / 2);
  }
  for (int i = 0; i < kGroups; ++i) spare_groups_[static_cast<std::size_t>(spare_count_++)] = i;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    workers_.push_back(std::make_unique<CameraWorker>(*cameras[i], static_cast<hal::CameraIndex>(i), clock, camera_bell_));
  sync_thread_ = std::thread([this] { synchronise(); });
  fit_thread_ = std::thread([this] { fit(); });
}

Pipeline::~Pipeline() {
  deactivate();
  stop_ = true;
  camera_bell_.ring();
  group_bell_.ring();
  sync_thread_.join();
  fit_thread_.join();
}

void Pipeline::activate() {
  ++callers_;
  const std::lock_guard lock(fitting_);
  --callers_;
  fitter_.reset();
  sequence_ = 0;
  for (auto* counter : {&formed_, &dropped_, &small_, &fitted_, &unmatched_}) counter->store(0);
  for (auto& stage : stages_) stage.reset();
  latency_.reset();
  active_ = true;
}

void Pipeline::deactivate() {
  ++callers_;
  const std::lock_guard lock(fitting_);
  --callers_;
  active_ = false;
}

void Pipeline::release(const ReleasedSlots& released) {
  for (const auto& entry : released.list()) workers_[static_cast<std::size_t>(entry.camera)]->give_back(entry.slot);
}

void Pipeline::release(const FrameGroup& group) {
  for (std::size_t cam = 0; cam < workers_.size(); ++cam) {
    if (group.slot[cam] >= 0) workers_[cam]->give_back(group.slot[cam]);
  }
}

void Pipeline::take_frames(Synchroniser& synchroniser, ReleasedSlots& released) {
  for (std::size_t cam = 0; cam < workers_.size(); ++cam) {
    for (int slot = 0; workers_[cam]->take(slot);) synchroniser.add({static_cast<int>(cam), workers_[cam]->frame(slot).captured, slot}, clock_.now(), released);
  }
}

void Pipeline::hand_over(const FrameGroup& group) {
  formed_.fetch_add(1, std::memory_order_relaxed);
  dropped_.fetch_add(group.skipped, std::memory_order_relaxed);
  if (spare_count_ == 0) {  // cannot happen while kGroups counts all owners; losing a group is the safe answer
    release(group);
    return;
  }
  const int index = spare_groups_[static_cast<std::size_t>(--spare_count_)];
  groups_[static_cast<std::size_t>(index)] = group;
  const int overtaken = waiting_.exchange(index, std::memory_order_acq_rel);
  if (overtaken >= 0) {
    release(groups_[static_cast<std::size_t>(overtaken)]);
    spare_groups_[static_cast<std::size_t>(spare_count_++)] = overtaken;
    dropped_.fetch_add(1, std::memory_order_relaxed);
  }
  group_bell_.ring();
}

void Pipeline::synchronise() {
  ::pthread_setname_np(::pthread_self(), "frame-sync");
  Synchroniser synchroniser(settings_.synchroniser);
  std::uint64_t unmatched = 0;
  while (!stop_) {
    camera_bell_.wait(5ms);
    sync_progress_.fetch_add(1, std::memory_order_relaxed);
    for (int index = 0; done_.pop(index);) {
      release(groups_[static_cast<std::size_t>(index)]);
      spare_groups_[static_cast<std::size_t>(spare_count_++)] = index;
    }
    ReleasedSlots released;
    take_frames(synchroniser, released);
    release(released);
    FrameGroup group;
    for (bool more = true; more;) {
      ReleasedSlots unused;
      more = synchroniser.next(clock_.now(), group, unused);
      release(unused);
      if (more) hand_over(group);
    }
    unmatched_.fetch_add(synchroniser.frames_dropped() - unmatched, std::memory_order_relaxed);
    unmatched = synchroniser.frames_dropped();
  }
}

void Pipeline::fit() {
  ::pthread_setname_np(::pthread_self(), "frame-fit");
  while (!stop_) {
    group_bell_.wait(20ms);
    fit_progress_.fetch_add(1, std::memory_order_relaxed);
    const int index = waiting_.exchange(-1, std::memory_order_acq_rel);
    if (index < 0) continue;
    fit_group(groups_[static_cast<std::size_t>(index)]);
    (void)done_.push(index);
    camera_bell_.ring();
  }
}

void Pipeline::fit_group(const FrameGroup& group) {
  // A mutex is not fair: without this, a busy fit thread could take it again and again before a waiting caller wakes.
  while (callers_ > 0) std::this_thread::yield();
  const std::lock_guard lock(fitting_);
  if (!active_) return;
  if (group.cameras < settings_.minimum_cameras) {
    small_.fetch_add(1, std::memory_order_relaxed);
    return;
  }
  const hal::MonotonicTime taken = clock_.now();
  FitInput input;
  input.frame = sequence_;
  input.reference = group.reference;
  for (std::size_t cam = 0; cam < workers_.size(); ++cam) {
    if (group.slot[cam] >= 0) input.frames[cam] = &workers_[cam]->frame(group.slot[cam]);
  }
  FrameRecord record;
  record.sequence = sequence_++;
  record.cameras = static_cast<std::uint8_t>(group.cameras);
  record.captured_ns = group.reference.time_since_epoch().count();
  record.captured_utc_ns = (clock_.utc_now().time_since_epoch() - (clock_.now() - group.reference)).count();
  record.groups_dropped = dropped_.load(std::memory_order_relaxed);
  fitter_.step(input, record);
  const hal::MonotonicTime fitted = clock_.now();
  record.stage_ns[static_cast<std::size_t>(Stage::wait)] = (taken - group.reference).count();
  sink_.publish(record);
  const hal::MonotonicTime published = clock_.now();
  record.published_ns = published.time_since_epoch().count();
  record.stage_ns[static_cast<std::size_t>(Stage::publish)] = (published - fitted).count();
  for (int s = 0; s < kStages; ++s) stages_[static_cast<std::size_t>(s)].add(hal::Nanoseconds(record.stage_ns[static_cast<std::size_t>(s)]));
  latency_.add(published - group.reference);
  fitted_.fetch_add(1, std::memory_order_relaxed);
  sink_.log(record);
}

std::vector<CameraStatus> Pipeline::cameras() const {
  std::vector<CameraStatus> out;
  for (const auto& worker : workers_) out.push_back(worker->status());
  return out;
}

int Pipeline::cameras_running() const {
  return static_cast<int>(std::count_if(workers_.begin(), workers_.end(), [](const auto& w) { return w->state() == CameraState::running; }));
}

bool Pipeline::all_ended() const {
  return std::all_of(workers_.begin(), workers_.end(), [](const auto& w) { return w->state() == CameraState::ended; });
}

PipelineCounters Pipeline::counters() const {
  return {.groups = formed_.load(),
          .groups_dropped = dropped_.load(),
          .groups_small = small_.load(),
          .fitted = fitted_.load(),
          .frames_unmatched = unmatched_.load()};
}

std::vector<std::uint64_t> Pipeline::progress() const {
  std::vector<std::uint64_t> out{sync_progress_.load(), fit_progress_.load()};
  for (const auto& worker : workers_) {
    if (worker->state() != CameraState::ended) out.push_back(worker->progress());
  }
  return out;
}

std::vector<MemoryItem> Pipeline::memory_plan() const {
  std::size_t slots = 0;
  for (const auto& worker : workers_) slots += worker->memory_bytes();
  std::vector<MemoryItem> plan{{"depth frame slots", slots}, {"groups, rings and histograms", sizeof(Pipeline) + workers_.size() * sizeof(CameraWorker)}};
  for (auto& item : fitter_.memory_plan()) plan.push_back(std::move(item));
  return plan;
}

}  // namespace booth::daemon
