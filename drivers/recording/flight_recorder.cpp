// Frames go from the cameras' threads through a few slots to one thread that packs them into memory; a second thread, where one is needed, writes to disk.
#include "drivers/recording/flight_recorder.hpp"

#include <pthread.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <ctime>
#include <deque>
#include <mutex>
#include <random>
#include <thread>

#include "drivers/recording/moment_ring.hpp"
#include "drivers/recording/recording_job.hpp"
#include "drivers/recording/rvl.hpp"
#include "drivers/recording/slot_ring.hpp"
#include "drivers/recording/text.hpp"

namespace booth::drivers {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kSlots = 8;                      ///< for each camera: a quarter of a second at 30 frames/s
constexpr std::size_t kGroups = 64, kEvents = 64;      ///< waiting
constexpr std::size_t kMemoryWithoutDepth = 4u << 20;  ///< 30 s of fitted frames and events are less than 1 MiB
constexpr std::size_t kLongestText = 4096;             ///< of an event
constexpr int kNiceness = 10;                          ///< the live path comes first

std::size_t pixels_of(const hal::CameraDescription& c) { return static_cast<std::size_t>(c.intrinsics.width) * static_cast<std::size_t>(c.intrinsics.height); }

std::size_t ring_bytes(const FlightRecorderSettings& settings) {
  return settings.depth ? settings.memory_bytes : std::min(settings.memory_bytes, kMemoryWithoutDepth);
}

struct DepthSlot {
  hal::MonotonicTime captured{};
  std::vector<std::uint16_t> depth;
};

class MemoryRecorder final : public hal::FlightRecorder {
 public:
  MemoryRecorder(const FlightRecorderSettings& settings, const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background,
                 hal::Clock& clock)
      : settings_(settings),
        cameras_(cameras),
        background_(background),
        clock_(clock),
        ring_(ring_bytes(settings), hal::from_seconds(settings.seconds)),
        context_{ring_, clock_, cameras_, background_, settings.keep_free_bytes, settings.seal, [this] { settle(10s); }} {
    std::size_t most = 0;
    if (settings_.depth)
      for (const auto& c : cameras_) {
        auto& slots = depth_.emplace_back(std::make_unique<SlotRing<DepthSlot, kSlots>>());
        for (auto& slot : slots->slots()) slot.depth.resize(pixels_of(c));
        most = std::max(most, pixels_of(c));
      }
    packed_.resize(rvl_bound(most));
    thread_ = std::thread([this] { run(); });
  }

  ~MemoryRecorder() override {
    ended_ = true;
    thread_.join();  // first: what is in the slots still comes into the recordings
    recording_.reset();
    snapshot_.reset();
  }

  void frame(const hal::DepthFrame& frame) noexcept override {
    const auto camera = static_cast<std::size_t>(hal::to_int(frame.camera));
    if (camera >= depth_.size() || frame.depth.size() != pixels_of(cameras_[camera])) return;
    DepthSlot* slot = depth_[camera]->to_write();
    if (!slot) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    slot->captured = frame.captured;
    std::memcpy(slot->depth.data(), frame.depth.data(), frame.depth.size() * sizeof(std::uint16_t));
    depth_[camera]->written();
  }

  void fitted(const hal::FittedGroup& group) noexcept override {
    hal::FittedGroup* slot = groups_.to_write();
    if (!slot) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    *slot = group;
    groups_.written();
  }

  void event(const std::string& kind, const std::string& source, const std::string& text) override {
    const std::lock_guard lock(event_mutex_);
    if (events_.size() >= kEvents) events_.pop_front();
    ++events_told_;
    events_.emplace_back(clock_.now(),
                         "{\"kind\":" + json_text(kind) + ",\"source\":" + json_text(source) + ",\"text\":" + json_text(text.substr(0, kLongestText)) + "}");
  }

  std::string record(bool depth, bool uncompressed, double seconds, hal::Nanoseconds patience) override {
    const std::lock_guard lock(job_mutex_);
    if (depth && !settings_.depth) return kNotAllowed;
    if (recording_ && recording_->running()) return "a recording is running already: " + recording_->status().path;
    RecordingOrder order{.path = settings_.directory / name("record"),
                         .depth = depth,
                         .uncompressed = uncompressed,
                         .from = ring_.next(),
                         .until = {},
                         .seconds = seconds,
                         .patience = patience,
                         .reason = "asked for"};
    return begin(recording_, std::move(order));
  }

  void stop() override {
    const std::lock_guard lock(job_mutex_);
    if (recording_) recording_->stop();
  }

  std::string snapshot(const std::string& reason) override {
    const std::lock_guard lock(job_mutex_);
    if (snapshot_ && snapshot_->running()) return "a snapshot is being written already: " + snapshot_->status().path;
    settle(100ms);  // what is in the slots now is of before the question, too
    RecordingOrder order{.path = settings_.directory / name("snapshot"),
                         .depth = settings_.depth,
                         .from = ring_.oldest(),
                         .until = ring_.next().number,
                         .patience = {},
                         .reason = reason};
    return begin(snapshot_, std::move(order));
  }

  hal::RecorderStatus status(bool asked) override {
    hal::RecorderStatus out;
    out.depth_allowed = settings_.depth;
    out.seconds_held = hal::seconds(ring_.held_time());
    out.bytes_held = ring_.held_bytes();
    out.bytes_capacity = ring_.capacity();
    out.dropped = dropped_;
    const std::lock_guard lock(job_mutex_);
    if (asked && recording_) recording_->asked();
    if (recording_) out.recording = recording_->status();
    if (snapshot_) out.snapshot = snapshot_->status();
    return out;
  }

 private:
  static constexpr const char* kNotAllowed =
      "depth images are personal data and are not recorded in this booth; record.depth = true in its configuration allows it";

  std::string name(const char* what) const {
    const std::time_t now = std::chrono::duration_cast<std::chrono::seconds>(clock_.utc_now().time_since_epoch()).count();
    std::tm utc{};
    ::gmtime_r(&now, &utc);
    char date[32], text[64];
    std::strftime(date, sizeof date, "%Y%m%dT%H%M%SZ", &utc);
    std::random_device random;
    std::snprintf(text, sizeof text, "%s-%04x-%s", date, random() & 0xffffu, what);
    return text;
  }

  std::string begin(std::unique_ptr<RecordingJob>& job, RecordingOrder order) {
    std::error_code ignored;
    std::filesystem::create_directories(settings_.directory.parent_path(), ignored);
    ::mkdir(settings_.directory.c_str(), 0700);
    if (::access(settings_.directory.c_str(), W_OK | X_OK) != 0)
      return settings_.directory.string() + " cannot be written: " + std::strerror(errno) + " (the key is record.directory)";
    job.reset();
    job = std::make_unique<RecordingJob>(context_, std::move(order));
    return {};
  }

  void run() {
    ::pthread_setname_np(::pthread_self(), "record-pack");
    // A thread is a process here: only this one is nice.
    (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);
    while (!ended_) {
      if (!pack()) std::this_thread::sleep_for(5ms);
    }
    while (pack()) {
    }
  }

  /// Until what was handed in before is in the ring; a processor that is taken away delays that, so for `patience` at most.
  void settle(std::chrono::milliseconds patience) {
    std::vector<std::size_t> frames;
    for (const auto& slots : depth_) frames.push_back(slots->handed_over());
    const std::size_t groups = groups_.handed_over();
    const std::uint64_t events = [this] {
      const std::lock_guard lock(event_mutex_);
      return events_told_;
    }();
    const auto packed = [&] {
      for (std::size_t i = 0; i < depth_.size(); ++i)
        if (depth_[i]->given_back() < frames[i]) return false;
      return groups_.given_back() >= groups && events_packed_ >= events;
    };
    for (auto left = patience; left > 0ms && !packed(); left -= 5ms) std::this_thread::sleep_for(5ms);
  }

  /// One frame of each camera, then all groups and events: what is small never waits long for what is large. False when there was nothing.
  bool pack() {
    bool any = false;
    for (std::size_t i = 0; i < depth_.size(); ++i)
      if (DepthSlot* slot = depth_[i]->to_read()) {
        const std::size_t size = rvl_pack(slot->depth, packed_.data());
        if (!ring_.push({Moment::Kind::depth, static_cast<std::uint8_t>(i), slot->captured}, {packed_.data(), size}))
          dropped_.fetch_add(1, std::memory_order_relaxed);
        depth_[i]->done();
        any = true;
      }
    while (const hal::FittedGroup* group = groups_.to_read()) {
      (void)ring_.push({Moment::Kind::group, 0, group->reference}, std::as_bytes(std::span(group, 1)));
      groups_.done();
      any = true;
    }
    std::deque<std::pair<hal::MonotonicTime, std::string>> events;
    std::uint64_t told = 0;
    {
      const std::lock_guard lock(event_mutex_);
      events.swap(events_);
      told = events_told_;
    }
    for (const auto& [time, text] : events) (void)ring_.push({Moment::Kind::event, 0, time}, std::as_bytes(std::span(text)));
    events_packed_ = told;
    return any;
  }

  const FlightRecorderSettings settings_;
  const std::vector<hal::CameraDescription> cameras_;
  const std::vector<hal::DepthFrame> background_;
  hal::Clock& clock_;
  MomentRing ring_;
  const RecordingContext context_;

  std::vector<std::unique_ptr<SlotRing<DepthSlot, kSlots>>> depth_;  ///< empty: depth is not kept
  SlotRing<hal::FittedGroup, kGroups> groups_;
  std::vector<std::byte> packed_;
  std::mutex event_mutex_;
  std::deque<std::pair<hal::MonotonicTime, std::string>> events_;
  std::uint64_t events_told_ = 0;  ///< under event_mutex_
  std::atomic<std::uint64_t> dropped_{0}, events_packed_{0};

  std::mutex job_mutex_;
  std::unique_ptr<RecordingJob> recording_, snapshot_;
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

}  // namespace

std::size_t flight_recorder_memory(const FlightRecorderSettings& settings, const std::vector<hal::CameraDescription>& cameras) {
  std::size_t out = ring_bytes(settings) + sizeof(MemoryRecorder);
  std::size_t most = 0;
  if (settings.depth)
    for (const auto& c : cameras) {
      out += kSlots * pixels_of(c) * sizeof(std::uint16_t);
      most = std::max(most, pixels_of(c));
    }
  return out + rvl_bound(most);
}

std::unique_ptr<hal::FlightRecorder> make_flight_recorder(const FlightRecorderSettings& settings, const std::vector<hal::CameraDescription>& cameras,
                                                          const std::vector<hal::DepthFrame>& background, hal::Clock& clock) {
  return std::make_unique<MemoryRecorder>(settings, cameras, background, clock);
}

}  // namespace booth::drivers
