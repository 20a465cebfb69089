// The mirror's thread and what is handed to it.
#include "daemon/dds/ros2/ros2_mirror.hpp"

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "daemon/dds/participant.hpp"
#include "daemon/dds/ros2/latest_value.hpp"
#include "daemon/dds/ros2/ros2_messages.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "daemon/pipeline/wakeup.hpp"

namespace booth::daemon {

struct Ros2Mirror::Impl {
  const RosNames names;
  hal::Clock& clock;
  Ros2Messages messages;
  std::array<dds_entity_t, kRos2Topics> writers{};

  // Between whoever publishes and the mirror's thread.
  LatestValue<Ros2Frame> frames;
  LatestValue<Ros2Cloud> clouds;
  Wakeup bell;
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> failures{0}, skipped{0};
  std::atomic<int> last_failure{0};

  // The publishing thread's.
  std::int64_t cloud_due_ns = 0;
  std::int64_t offered_ns = -1;  ///< which frame the draft of a cloud belongs to; negative: there is none

  // The mirror's thread's.
  bool said = false, said_present = false;
  std::int64_t said_at_ns = 0;

  std::thread thread;

  Impl(dds_entity_t participant, const std::string& booth, const Ros2Settings& settings, hal::Clock& c)
      : names(booth, settings.name_space), clock(c), messages(names, settings.cameras) {
    // In no partition, whatever the booth's own topics are in.
    const dds_entity_t publisher = dds_check(dds_create_publisher(participant, nullptr, nullptr), "making a publisher for ROS 2");
    for (int t = 0; t < kRos2Topics; ++t) writers[static_cast<std::size_t>(t)] = make_ros2_writer(participant, publisher, static_cast<Ros2Topic>(t), names);
    const auto now = builtin_interfaces_msg_dds__Time_{};  // static frames hold at every time
    for (std::uint32_t i = 0; i < messages.tf_static.transforms._length; ++i) messages.tf_static.transforms._buffer[i].header.stamp = now;
    write(Ros2Topic::tf_static, &messages.tf_static);
    thread = std::thread([this] { run(); });
  }
  ~Impl() {
    stop = true;
    bell.ring();
    thread.join();
  }

  void write(Ros2Topic topic, const void* sample) noexcept {
    const dds_return_t result = dds_write(writers[static_cast<std::size_t>(topic)], sample);
    if (result >= 0) return;
    failures.fetch_add(1, std::memory_order_relaxed);
    last_failure.store(result, std::memory_order_relaxed);
  }

  void run() {
    ::pthread_setname_np(::pthread_self(), "frame-ros2");
    while (!stop) {
      bell.wait(std::chrono::milliseconds(500));
      if (const Ros2Frame* frame = frames.take()) send(*frame);
      if (const Ros2Cloud* cloud = clouds.take()) {
        messages.fill(*cloud);
        write(Ros2Topic::cloud, &messages.cloud);
      }
    }
  }

  void send(const Ros2Frame& frame) {
    const std::int64_t now = clock.now().time_since_epoch().count();
    if (!said || frame.present != said_present || now - said_at_ns >= kTrackedPeriodNs) {
      messages.fill_tracked(frame.present, frame.captured_utc_ns);
      write(Ros2Topic::tracked, &messages.tracked);
      said = true;
      said_present = frame.present;
      said_at_ns = now;
    }
    if (!frame.present) return;
    messages.fill(frame);
    write(Ros2Topic::tf, &messages.tf);
    write(Ros2Topic::joint_states, &messages.joint_states);
    write(Ros2Topic::joints, &messages.joints);
  }

  void hand_over() noexcept {
    if (!frames.submit()) skipped.fetch_add(1, std::memory_order_relaxed);
    bell.ring();
  }
};

Ros2Mirror::Ros2Mirror(dds_entity_t participant, const std::string& booth, const Ros2Settings& settings, hal::Clock& clock)
    : impl_(std::make_unique<Impl>(participant, booth, settings, clock)) {}

Ros2Mirror::~Ros2Mirror() = default;

void Ros2Mirror::offer_cloud(const fit::Cloud& cloud, std::int64_t captured_ns) noexcept {
  // A recording that begins again goes back in time: then the next cloud is due at once.
  if (captured_ns < impl_->cloud_due_ns && captured_ns >= impl_->cloud_due_ns - kCloudPeriodNs) return;
  impl_->clouds.draft().take(cloud);
  impl_->offered_ns = captured_ns;
}

void Ros2Mirror::publish(const FrameRecord& frame) noexcept {
  Ros2Frame& out = impl_->frames.draft();
  out.captured_utc_ns = frame.captured_utc_ns;
  out.pose.joints = frame.joints;
  out.pose.rotation = frame.rotation;
  std::copy(frame.q.begin() + fit::kRootDofs, frame.q.end(), out.angles.begin());
  out.present = frame.person != PersonState::lost && is_finite(out.pose);
  if (out.present && impl_->offered_ns == frame.captured_ns) {
    impl_->clouds.draft().captured_utc_ns = frame.captured_utc_ns;
    (void)impl_->clouds.submit();
    // In step with the frames, and never two close together.
    impl_->cloud_due_ns = std::clamp(impl_->cloud_due_ns + kCloudPeriodNs, frame.captured_ns + kCloudPeriodNs / 2, frame.captured_ns + kCloudPeriodNs);
  }
  impl_->offered_ns = -1;
  impl_->hand_over();
}

void Ros2Mirror::publish_idle(std::int64_t utc_ns) noexcept {
  Ros2Frame& out = impl_->frames.draft();
  out.present = false;
  out.captured_utc_ns = utc_ns;
  impl_->hand_over();
}

std::uint64_t Ros2Mirror::failures() const { return impl_->failures.load(std::memory_order_relaxed); }
int Ros2Mirror::last_failure() const { return impl_->last_failure.load(std::memory_order_relaxed); }
std::uint64_t Ros2Mirror::frames_skipped() const { return impl_->skipped.load(std::memory_order_relaxed); }
std::size_t Ros2Mirror::memory_bytes() { return sizeof(Impl); }

}  // namespace booth::daemon
