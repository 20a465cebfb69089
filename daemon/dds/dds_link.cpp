// The only file that speaks to Cyclone DDS.
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

namespace booth::daemon {
namespace {

dds_entity_t check(dds_entity_t entity, const char* what) {
  if (entity < 0)
    throw std::runtime_error(
        fmt::format("DDS: {} failed: {} (keys dds.domain, dds.interface, dds.multicast, dds.peers; or dds.enabled=false)", what, dds_strretcode(-entity)));
  return entity;
}

struct Qos {
  dds_qos_t* qos = dds_create_qos();
  Qos() {
    dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
    dds_qset_data_representation(qos, 1, &xcdr1);
  }
  ~Qos() { dds_delete_qos(qos); }
  Qos(const Qos&) = delete;
  operator dds_qos_t*() const { return qos; }  // NOLINT(google-explicit-constructor): it stands for the library's handle
};

/// Copies into a bounded IDL string, cutting what is too long.
template <std::size_t N>
void set_text(char (&to)[N], const std::string& from) {
  const std::size_t n = std::min(N - 1, from.size());
  std::memcpy(to, from.data(), n);
  std::memset(to + n, 0, N - n);
}

bool is_address(const std::string& text) { return text.find_first_not_of("0123456789.") == std::string::npos || text.find(':') != std::string::npos; }

constexpr std::uint32_t kMostMeasurements = 32, kMostCameras = 8;

}  // namespace

std::string dds_configuration(const DdsSettings& settings) {
  std::string interfaces;
  if (!settings.interface.empty())
    interfaces = fmt::format("<Interfaces><NetworkInterface {}=\"{}\"/></Interfaces>", is_address(settings.interface) ? "address" : "name", settings.interface);
  std::string peers;
  if (!settings.multicast) peers += "<Peer Address=\"localhost\"/>";
  for (const auto& peer : settings.peers) peers += fmt::format("<Peer Address=\"{}\"/>", peer);
  if (!peers.empty()) peers = "<Peers>" + peers + "</Peers>";
  // Without multicast participants are found at ports counted from zero; 32 of them on one machine are enough for any booth.
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\"><General>{}<AllowMulticast>{}</AllowMulticast></General>"
      "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>{}</Discovery></Domain></CycloneDDS>",
      interfaces, settings.multicast ? "true" : "false", peers);
}

struct DdsLink::Impl {
  DdsSettings settings;
  hal::Clock& clock;
  std::function<DdsAnswer(DdsCommand)> on_command;

  dds_entity_t domain = 0, participant = 0, publisher = 0, subscriber = 0;
  dds_entity_t skeleton_writer = 0, body_writer = 0, status_writer = 0, event_writer = 0, reply_writer = 0, command_reader = 0;
  dds_entity_t waitset = 0, guard = 0;
  std::thread thread;
  std::atomic<bool> stop{false};

  std::mutex skeleton_mutex;
  booth_msg_Skeleton skeleton{};
  std::array<double, kRecordShape> skeleton_beta{};
  std::mutex slow_mutex;  ///< body, status, event, reply
  std::uint64_t event_number = 0;
  std::atomic<std::uint64_t> failures{0};
  std::atomic<dds_return_t> last_failure{0};

  Impl(const DdsSettings& s, hal::Clock& c, std::function<DdsAnswer(DdsCommand)> callback) : settings(s), clock(c), on_command(std::move(callback)) {}

  std::int64_t utc_ns() const { return clock.utc_now().time_since_epoch().count(); }
  std::int64_t monotonic_ns() const { return clock.now().time_since_epoch().count(); }

  void note(dds_return_t result) {
    if (result >= 0) return;
    failures.fetch_add(1, std::memory_order_relaxed);
    last_failure.store(result, std::memory_order_relaxed);
  }

  dds_entity_t writer(const dds_topic_descriptor_t& type, const char* topic_name, const Qos& qos) {
    const dds_entity_t topic = check(dds_create_topic(participant, &type, topic_name, nullptr, nullptr), topic_name);
    return check(dds_create_writer(publisher, topic, qos, nullptr), topic_name);
  }

  void open() {
    domain = dds_create_domain(settings.domain, dds_configuration(settings).c_str());
    // Another part of this process may have opened the domain already (tests do); its configuration then holds.
    if (domain < 0 && domain != DDS_RETCODE_PRECONDITION_NOT_MET) check(domain, "opening the domain");
    participant = check(dds_create_participant(settings.domain, nullptr, nullptr), "joining the domain");
    Qos partition;
    const char* names[] = {settings.booth.c_str()};
    dds_qset_partition(partition, 1, names);
    publisher = check(dds_create_publisher(participant, partition, nullptr), "making a publisher");
    subscriber = check(dds_create_subscriber(participant, partition, nullptr), "making a subscriber");

    Qos skeletons;
    dds_qset_reliability(skeletons, DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(skeletons, DDS_HISTORY_KEEP_LAST, 1);
    dds_qset_deadline(skeletons, DDS_MSECS(100));
    dds_qset_liveliness(skeletons, DDS_LIVELINESS_AUTOMATIC, DDS_MSECS(500));
    skeleton_writer = writer(booth_msg_Skeleton_desc, "booth/skeleton", skeletons);

    Qos latest;
    dds_qset_reliability(latest, DDS_RELIABILITY_RELIABLE, DDS_MSECS(10));
    dds_qset_durability(latest, DDS_DURABILITY_TRANSIENT_LOCAL);
    dds_qset_history(latest, DDS_HISTORY_KEEP_LAST, 1);
    body_writer = writer(booth_msg_Body_desc, "booth/body", latest);
    status_writer = writer(booth_msg_Status_desc, "booth/status", latest);

    Qos every;
    dds_qset_reliability(every, DDS_RELIABILITY_RELIABLE, DDS_MSECS(10));
    dds_qset_history(every, DDS_HISTORY_KEEP_ALL, 0);
    dds_qset_resource_limits(every, 1000, 10, 1000);
    event_writer = writer(booth_msg_Event_desc, "booth/event", every);
    reply_writer = writer(booth_msg_Reply_desc, "booth/reply", every);
    const dds_entity_t topic = check(dds_create_topic(participant, &booth_msg_Command_desc, "booth/command", nullptr, nullptr), "booth/command");
    command_reader = check(dds_create_reader(subscriber, topic, every, nullptr), "booth/command");

    waitset = check(dds_create_waitset(participant), "making a waitset");
    guard = check(dds_create_guardcondition(participant), "making a guard condition");
    const dds_entity_t readable = check(dds_create_readcondition(command_reader, DDS_ANY_STATE), "watching booth/command");
    check(dds_waitset_attach(waitset, guard, 0), "watching the guard condition");
    check(dds_waitset_attach(waitset, readable, 1), "watching booth/command");
    thread = std::thread([this] { hear(); });
  }

  void close() {
    stop = true;
    if (thread.joinable()) {
      dds_set_guardcondition(guard, true);
      thread.join();
    }
    if (participant > 0) dds_delete(participant);
    if (domain > 0) dds_delete(domain);
  }

  void hear() {
    while (!stop) {
      dds_attach_t which[2];
      if (dds_waitset_wait(waitset, which, 2, DDS_SECS(1)) < 0) std::this_thread::sleep_for(std::chrono::milliseconds(100));
      void* samples[1] = {nullptr};
      dds_sample_info_t info[1];
      while (!stop && dds_take(command_reader, samples, info, 1, 1) == 1) {
        if (info[0].valid_data) answer(*static_cast<const booth_msg_Command*>(samples[0]));
        (void)dds_return_loan(command_reader, samples, 1);
        samples[0] = nullptr;
      }
    }
  }

  void answer(const booth_msg_Command& command) {
    if (settings.booth != command.booth) return;
    DdsAnswer result;
    if (command.kind == booth_msg_COMMAND_START || command.kind == booth_msg_COMMAND_STOP) {
      result = on_command(command.kind == booth_msg_COMMAND_START ? DdsCommand::start : DdsCommand::stop);
    } else {
      result.text = "this command is not known";
    }
    booth_msg_Reply reply{};
    set_text(reply.booth, settings.booth);
    reply.id = command.id;
    reply.accepted = result.accepted;
    reply.state = static_cast<booth_msg_SessionState>(result.state);
    set_text(reply.text, result.text);
    const std::lock_guard lock(slow_mutex);
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
    : impl_(std::make_unique<Impl>(settings, clock, std::move(on_command))) {
  set_text(impl_->skeleton.booth, settings.booth);
  impl_->skeleton.beta._buffer = impl_->skeleton_beta.data();
  impl_->skeleton.beta._maximum = kRecordShape;
  try {
    impl_->open();
  } catch (...) {
    impl_->close();
    throw;
  }
}

DdsLink::~DdsLink() { impl_->close(); }

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
}

void DdsLink::publish_idle(std::uint8_t session_state) noexcept {
  const std::lock_guard lock(impl_->skeleton_mutex);
  booth_msg_Skeleton& s = impl_->skeleton;
  const booth_msg_Skeleton old = s;
  s = {};
  std::memcpy(s.booth, old.booth, sizeof s.booth);
  s.serial_number = old.serial_number;
  s.beta = old.beta;
  s.beta._length = 0;
  s.state = static_cast<booth_msg_SessionState>(session_state);
  s.person = booth_msg_PERSON_LOST;
  s.capture_utc_ns = impl_->utc_ns();
  s.capture_monotonic_ns = impl_->monotonic_ns();
  for (auto& joint : s.joints) joint.orientation[3] = 1;
  impl_->stamp_and_write();
}

void DdsLink::publish(const BodySample& body) {
  booth_msg_Body sample{};
  set_text(sample.booth, impl_->settings.booth);
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
    set_text(measurements[i].name, body.measurements[i].first);
    measurements[i].value = body.measurements[i].second;
  }
  sample.measurements._buffer = measurements.data();
  sample.measurements._maximum = sample.measurements._length = static_cast<std::uint32_t>(measurements.size());
  const std::lock_guard lock(impl_->slow_mutex);
  impl_->note(dds_write(impl_->body_writer, &sample));
}

void DdsLink::publish(const StatusSample& status) {
  booth_msg_Status sample{};
  set_text(sample.booth, impl_->settings.booth);
  sample.utc_ns = impl_->utc_ns();
  sample.monotonic_ns = impl_->monotonic_ns();
  sample.state = static_cast<booth_msg_SessionState>(status.state);
  sample.degraded = status.degraded;
  sample.paused = status.paused;
  sample.emergency_latched = status.latched;
  set_text(sample.session, status.session);
  set_text(sample.alarm, status.alarm);
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
  const std::lock_guard lock(impl_->slow_mutex);
  impl_->note(dds_write(impl_->status_writer, &sample));
}

void DdsLink::publish_event(const std::string& kind, const std::string& source, const std::string& text) {
  booth_msg_Event sample{};
  set_text(sample.booth, impl_->settings.booth);
  sample.utc_ns = impl_->utc_ns();
  set_text(sample.kind, kind);
  set_text(sample.source, source);
  set_text(sample.text, text);
  const std::lock_guard lock(impl_->slow_mutex);
  sample.serial_number = ++impl_->event_number;
  impl_->note(dds_write(impl_->event_writer, &sample));
}

std::uint64_t DdsLink::failures() const { return impl_->failures.load(); }

std::string DdsLink::last_failure() const {
  const dds_return_t code = impl_->last_failure.load();
  return code < 0 ? dds_strretcode(-code) : "";
}

}  // namespace booth::daemon
