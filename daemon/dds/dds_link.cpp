// Samples from plain values, and the thread that hears commands.
#include "daemon/dds/dds_link.hpp"

#include <dds/dds.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "booth.h"
#include "daemon/dds/bounded_text.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/ros2/ros2_mirror.hpp"
#include "daemon/dds/topics.hpp"

namespace booth::daemon {
namespace {

constexpr std::uint32_t kMostMeasurements = 32, kMostCameras = booth_msg_MAX_CAMERAS, kMostFaults = booth_msg_MAX_FAULTS;

}  // namespace

struct DdsLink::Impl {
  const std::string booth;
  hal::Clock& clock;
  std::atomic<std::uint8_t> state{0};  ///< SessionState, as last published
  CommandGuard guard;

  DdsParticipant dds;
  dds_entity_t skeleton_writer = 0, body_writer = 0, status_writer = 0, event_writer = 0, reply_writer = 0, command_reader = 0;
  dds_entity_t waitset = 0, end = 0;
  std::thread thread;
  std::atomic<bool> stop{false};

  std::unique_ptr<Ros2Mirror> ros2;  ///< null when it is off; published to under skeleton_mutex
  std::mutex skeleton_mutex;
  booth_msg_Skeleton skeleton{};
  std::array<double, kRecordShape> skeleton_beta{};
  std::mutex event_mutex;
  std::uint64_t event_number = 0;
  std::atomic<std::uint64_t> failures{0}, ignored{0};
  std::atomic<dds_return_t> last_failure{0};

  Impl(const DdsSettings& settings, hal::Clock& c, CommandGuard::CarryOut on_command)
      : booth(settings.booth),
        clock(c),
        guard(booth_msg_VERSION, c.now(), std::move(on_command), [this] { return state.load(std::memory_order_relaxed); }),
        dds(settings) {
    set_text(skeleton.booth, booth);
    skeleton.version = booth_msg_VERSION;
    skeleton.beta._buffer = skeleton_beta.data();
    skeleton.beta._maximum = kRecordShape;
    if (settings.ros2) ros2 = std::make_unique<Ros2Mirror>(dds.participant(), booth, *settings.ros2, clock);
    open();
  }
  ~Impl() {
    stop = true;
    if (!thread.joinable()) return;
    dds_set_guardcondition(end, true);
    thread.join();
  }

  std::int64_t utc_ns() const { return clock.utc_now().time_since_epoch().count(); }
  std::int64_t monotonic_ns() const { return clock.now().time_since_epoch().count(); }

  void note(dds_return_t result) {
    if (result >= 0) return;
    failures.fetch_add(1, std::memory_order_relaxed);
    last_failure.store(result, std::memory_order_relaxed);
  }

  void open() {
    const auto writer = [this](DdsTopic topic) { return make_writer(dds.participant(), dds.publisher(), topic); };
    skeleton_writer = writer(DdsTopic::skeleton);
    body_writer = writer(DdsTopic::body);
    status_writer = writer(DdsTopic::status);
    event_writer = writer(DdsTopic::event);
    reply_writer = writer(DdsTopic::reply);
    open_ears();
    thread = std::thread([this] { hear(); });
  }

  /// What is for other booths is thrown away before it takes room: whoever writes under a thousand names makes no thousand instances here.
  static bool is_for(const void* sample, void* impl) { return static_cast<const Impl*>(impl)->booth == static_cast<const booth_msg_Command*>(sample)->booth; }

  void open_ears() {
    const char* name = topic_info(DdsTopic::command).name;
    const dds_entity_t topic = dds_check(dds_create_topic(dds.participant(), topic_info(DdsTopic::command).type, name, nullptr, nullptr), name);
    dds_check(dds_set_topic_filter_and_arg(topic, is_for, this), name);
    const DdsQos qos;
    set_topic_qos(DdsTopic::command, qos);
    command_reader = dds_check(dds_create_reader(dds.subscriber(), topic, qos, nullptr), name);
    waitset = dds_check(dds_create_waitset(dds.participant()), "making a waitset");
    end = dds_check(dds_create_guardcondition(dds.participant()), "making a guard condition");
    const dds_entity_t readable = dds_check(dds_create_readcondition(command_reader, DDS_ANY_STATE), "watching booth/command");
    dds_check(dds_waitset_attach(waitset, end, 0), "watching the guard condition");
    dds_check(dds_waitset_attach(waitset, readable, 1), "watching booth/command");
  }

  void hear() {
    while (!stop) {
      dds_attach_t which[2];
      if (dds_waitset_wait(waitset, which, 2, DDS_SECS(1)) < 0) std::this_thread::sleep_for(std::chrono::milliseconds(100));
      void* samples[1] = {nullptr};
      dds_sample_info_t info[1];
      while (!stop && dds_take(command_reader, samples, info, 1, 1) == 1) {
        if (info[0].valid_data) answer(*static_cast<const booth_msg_Command*>(samples[0]), info[0].publication_handle);
        (void)dds_return_loan(command_reader, samples, 1);
        samples[0] = nullptr;
      }
    }
  }

  void answer(const booth_msg_Command& command, dds_instance_handle_t writer) {
    const RemoteCommand remote{.writer = writer,
                               .version = command.version,
                               .sender = command.sender,
                               .id = command.id,
                               .utc_ns = command.utc_ns,
                               .kind = static_cast<std::uint32_t>(command.kind)};
    const auto result = guard.handle(remote, utc_ns(), clock.now());
    ignored.store(guard.ignored(), std::memory_order_relaxed);
    if (!result) return;
    booth_msg_Reply reply{};
    set_text(reply.booth, booth);
    reply.version = booth_msg_VERSION;
    set_text(reply.sender, remote.sender);
    reply.id = remote.id;
    reply.accepted = result->answer.accepted;
    reply.repeated = result->repeated;
    reply.state = static_cast<booth_msg_SessionState>(result->answer.state);
    set_text(reply.text, result->answer.text);
    note(dds_write(reply_writer, &reply));
  }

  /// Under skeleton_mutex.
  void stamp_and_write() {
    ++skeleton.serial_number;
    skeleton.publish_utc_ns = utc_ns();
    skeleton.publish_monotonic_ns = monotonic_ns();
    note(dds_write(skeleton_writer, &skeleton));
  }
};

DdsLink::DdsLink(const DdsSettings& settings, hal::Clock& clock, std::function<DdsAnswer(DdsCommand)> on_command)
    : impl_(std::make_unique<Impl>(settings, clock, std::move(on_command))) {}

DdsLink::~DdsLink() = default;

void DdsLink::offer_cloud(const fit::Cloud& cloud, std::int64_t captured_ns) noexcept {
  if (impl_->ros2) impl_->ros2->offer_cloud(cloud, captured_ns);
}

void DdsLink::publish(const FrameRecord& frame) noexcept {
  const std::lock_guard lock(impl_->skeleton_mutex);
  booth_msg_Skeleton& s = impl_->skeleton;
  s.frame = frame.sequence;
  s.capture_utc_ns = frame.captured_utc_ns;
  s.capture_monotonic_ns = frame.captured_ns;
  s.state = static_cast<booth_msg_SessionState>(frame.session_state);
  s.person = static_cast<booth_msg_PersonState>(frame.person);
  s.sex = static_cast<booth_msg_BodySex>(frame.sex);
  std::copy(frame.q.begin(), frame.q.end(), s.q);
  s.beta._length = frame.shape_count;
  std::copy_n(frame.beta.begin(), frame.shape_count, impl_->skeleton_beta.begin());
  for (std::size_t j = 0; j < kRecordJoints; ++j) {
    std::copy(frame.joints[j].begin(), frame.joints[j].end(), s.joints[j].position);
    std::copy(frame.rotation[j].begin(), frame.rotation[j].end(), s.joints[j].orientation);
    std::copy(frame.covariance[j].begin(), frame.covariance[j].end(), s.joints[j].covariance);
    s.joints[j].seen = frame.seen[j] != 0;
  }
  s.residual = frame.residual;
  s.coverage = frame.coverage;
  s.cameras = frame.cameras;
  s.others = frame.others;
  s.groups_dropped = frame.groups_dropped;
  impl_->stamp_and_write();
  if (impl_->ros2) impl_->ros2->publish(frame);
}

void DdsLink::publish_idle(std::uint8_t session_state) noexcept {
  const std::lock_guard lock(impl_->skeleton_mutex);
  booth_msg_Skeleton& s = impl_->skeleton;
  const booth_msg_Skeleton old = s;
  s = {};
  std::memcpy(s.booth, old.booth, sizeof s.booth);
  s.version = old.version;
  s.serial_number = old.serial_number;
  s.beta = old.beta;
  s.beta._length = 0;
  s.state = static_cast<booth_msg_SessionState>(session_state);
  s.person = booth_msg_PERSON_LOST;
  s.capture_utc_ns = impl_->utc_ns();
  s.capture_monotonic_ns = impl_->monotonic_ns();
  for (auto& joint : s.joints) joint.orientation[3] = 1;
  impl_->stamp_and_write();
  if (impl_->ros2) impl_->ros2->publish_idle(s.capture_utc_ns);
}

void DdsLink::publish(const BodySample& body) {
  booth_msg_Body sample{};
  set_text(sample.booth, impl_->booth);
  sample.version = booth_msg_VERSION;
  set_text(sample.session, body.session);
  set_text(sample.model_version, body.model_version);
  sample.utc_ns = impl_->utc_ns();
  sample.sex = static_cast<booth_msg_BodySex>(body.sex);
  std::vector<double> beta(body.beta.begin(), body.beta.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(body.beta.size(), kRecordShape)));
  sample.beta._buffer = beta.data();
  sample.beta._maximum = sample.beta._length = static_cast<std::uint32_t>(beta.size());
  std::copy(body.bone_lengths.begin(), body.bone_lengths.end(), sample.bone_lengths);
  std::vector<booth_msg_Measurement> measurements(std::min<std::size_t>(body.measurements.size(), kMostMeasurements));
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    set_text(measurements[i].name, body.measurements[i].name);
    set_text(measurements[i].unit, body.measurements[i].unit);
    measurements[i].value = body.measurements[i].value;
    measurements[i].deviation = body.measurements[i].deviation;
  }
  sample.measurements._buffer = measurements.data();
  sample.measurements._maximum = sample.measurements._length = static_cast<std::uint32_t>(measurements.size());
  impl_->note(dds_write(impl_->body_writer, &sample));
}

void DdsLink::publish(const StatusSample& status) {
  booth_msg_Status sample{};
  set_text(sample.booth, impl_->booth);
  sample.version = booth_msg_VERSION;
  sample.utc_ns = impl_->utc_ns();
  sample.monotonic_ns = impl_->monotonic_ns();
  sample.state = static_cast<booth_msg_SessionState>(status.state);
  sample.degraded = status.degraded;
  sample.paused = status.paused;
  sample.emergency_latched = status.latched;
  set_text(sample.session, status.session);
  set_text(sample.alarm, status.alarm);
  set_text(sample.software, status.software);
  std::vector<booth_msg_Fault> faults(std::min<std::size_t>(status.faults.size(), kMostFaults));
  for (std::size_t i = 0; i < faults.size(); ++i) {
    set_text(faults[i].source, status.faults[i].first);
    set_text(faults[i].text, status.faults[i].second);
  }
  sample.faults._buffer = faults.data();
  sample.faults._maximum = sample.faults._length = static_cast<std::uint32_t>(faults.size());
  std::vector<booth_msg_Camera> cameras(std::min<std::size_t>(status.cameras.size(), kMostCameras));
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const StatusSample::Camera& from = status.cameras[i];
    set_text(cameras[i].name, from.name);
    set_text(cameras[i].state, from.state);
    cameras[i].fps = from.fps;
    cameras[i].delivered = from.delivered;
    cameras[i].dropped = from.dropped;
    cameras[i].restarts = from.restarts;
  }
  sample.cameras._buffer = cameras.data();
  sample.cameras._maximum = sample.cameras._length = static_cast<std::uint32_t>(cameras.size());
  sample.frames = status.frames;
  sample.groups_dropped = status.groups_dropped;
  sample.fps = status.fps;
  sample.latency_p50_ms = status.latency_p50_ms;
  sample.latency_p99_ms = status.latency_p99_ms;
  sample.residual = status.residual;
  sample.calibration_age_s = status.calibration_age_s;
  sample.calibration_residual = status.calibration_residual;
  sample.disk_free_bytes = status.disk_free_bytes;
  sample.disk_total_bytes = status.disk_total_bytes;
  impl_->state.store(status.state, std::memory_order_relaxed);
  impl_->note(dds_write(impl_->status_writer, &sample));
}

void DdsLink::publish_event(const std::string& kind, const std::string& source, const std::string& text) {
  booth_msg_Event sample{};
  set_text(sample.booth, impl_->booth);
  sample.version = booth_msg_VERSION;
  sample.utc_ns = impl_->utc_ns();
  set_text(sample.kind, kind);
  set_text(sample.source, source);
  set_text(sample.text, text);
  const std::lock_guard lock(impl_->event_mutex);  // events go out in the order of their numbers
  sample.serial_number = ++impl_->event_number;
  impl_->note(dds_write(impl_->event_writer, &sample));
}

std::uint64_t DdsLink::commands_ignored() const { return impl_->ignored.load(std::memory_order_relaxed); }

std::uint64_t DdsLink::failures() const { return impl_->failures.load() + (impl_->ros2 ? impl_->ros2->failures() : 0); }

std::string DdsLink::last_failure() const {
  dds_return_t code = impl_->last_failure.load();
  if (code >= 0 && impl_->ros2) code = impl_->ros2->last_failure();
  return code < 0 ? dds_strretcode(-code) : "";
}

}  // namespace booth::daemon
