// Two readers and a map.
#include "daemon/dds/booth_listener.hpp"

#include <dds/dds.h>

#include <algorithm>

#include "booth.h"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"

namespace booth::daemon {

const char* session_state_name(std::uint8_t state) {
  constexpr std::array kNames{"idle", "estimating", "tracking", "searching", "finishing", "countdown", "calibrating"};
  return state < kNames.size() ? kNames[state] : "?";
}

const char* person_state_name(std::uint8_t person) {
  constexpr std::array kNames{"lost", "estimated", "tracked"};
  return person < kNames.size() ? kNames[person] : "?";
}

namespace {

/// Length of the UTF-8 character at text[i]; 0 when there is none.
std::size_t utf8_length(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u; };
  const unsigned first = byte(i);
  const std::size_t n = first < 0x80 ? 1 : first >= 0xC2 && first < 0xE0 ? 2 : first >= 0xE0 && first < 0xF0 ? 3 : first >= 0xF0 && first < 0xF5 ? 4 : 0;
  for (std::size_t k = 1; k < n; ++k)
    if ((byte(i + k) & 0xC0) != 0x80) return 0;
  return n;
}

}  // namespace

std::string printable(const std::string& text, std::size_t limit) {
  std::string out;
  for (std::size_t i = 0; i < text.size() && out.size() < limit;) {
    const std::size_t n = utf8_length(text, i);
    const auto c = static_cast<unsigned char>(text[i]);
    // 0xC2 0x80..0x9F are control characters, too (0x9B begins an escape sequence).
    const bool control = n == 0 || (n == 1 && (c < 0x20 || c == 0x7F)) || (n == 2 && c == 0xC2 && static_cast<unsigned char>(text[i + 1]) < 0xA0);
    out += control ? "?" : text.substr(i, n);
    i += std::max<std::size_t>(n, 1);
  }
  return out;
}

struct BoothListener::Impl {
  explicit Impl(const DdsSettings& settings) : dds(settings) {
    skeletons = make_reader(dds.participant(), dds.subscriber(), DdsTopic::skeleton);
    status = make_reader(dds.participant(), dds.subscriber(), DdsTopic::status);
    waitset = dds_check(dds_create_waitset(dds.participant()), "making a waitset");
    for (const dds_entity_t reader : {skeletons, status})
      dds_check(dds_waitset_attach(waitset, dds_check(dds_create_readcondition(reader, DDS_ANY_STATE), "watching a reader"), 0), "watching a reader");
  }

  /// Calls `look(sample, info)` for all that wait.
  template <class T, class F>
  void take(dds_entity_t reader, F look) {
    constexpr int kBatch = 32;
    for (int n = kBatch, rounds = 0; n == kBatch && rounds < 64; ++rounds) {
      void* samples[kBatch] = {};
      dds_sample_info_t info[kBatch];
      n = dds_take(reader, samples, info, kBatch, kBatch);
      for (int i = 0; i < n; ++i) look(*static_cast<const T*>(samples[i]), info[i]);
      if (n > 0) (void)dds_return_loan(reader, samples, n);
    }
  }

  /// Whom a booth's name came from lately, to find two booths of one name.
  struct Writers {
    dds_instance_handle_t current = 0, other = 0;
    int changes = 0;
  };

  DdsParticipant dds;
  dds_entity_t skeletons = 0, status = 0, waitset = 0;
  std::map<std::string, Writers> writers;
};

BoothListener::BoothListener(const DdsSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
BoothListener::~BoothListener() = default;

HeardBooth* BoothListener::place(const char* name) {
  const auto it = booths_.find(name);
  if (it != booths_.end()) return &it->second;
  if (booths_.size() >= kMostBooths) {
    ++left_out_;
    return nullptr;
  }
  return &booths_[name];
}

int BoothListener::poll(std::chrono::milliseconds wait) {
  dds_attach_t which[2];
  (void)dds_waitset_wait(impl_->waitset, which, 2, DDS_MSECS(wait.count()));
  int count = 0;
  take_skeletons(count);
  take_status();
  return count;
}

void BoothListener::take_skeletons(int& count) {
  impl_->take<booth_msg_Skeleton>(impl_->skeletons, [&](const booth_msg_Skeleton& s, const dds_sample_info_t& info) {
    HeardBooth* booth = place(s.booth);
    if (!booth) return;
    booth->present = info.instance_state == DDS_IST_ALIVE;
    if (!info.valid_data) return;
    ++count;
    auto& writers = impl_->writers[s.booth];
    const bool same = info.publication_handle == writers.current;
    if (!same) {
      // A booth that was started anew changes its writer once; two that speak in turns change it again and again.
      writers.changes = info.publication_handle == writers.other ? writers.changes + 1 : 0;
      writers.other = writers.current;
      writers.current = info.publication_handle;
    }
    booth->twice = writers.changes >= 2;
    HeardSkeleton& to = booth->skeleton;
    if (same && booth->skeleton_known && s.serial_number > to.serial_number) booth->skeletons_lost += s.serial_number - to.serial_number - 1;
    ++booth->skeletons;
    booth->skeleton_known = true;
    to.serial_number = s.serial_number;
    to.frame = s.frame;
    to.groups_dropped = s.groups_dropped;
    to.capture_utc_ns = s.capture_utc_ns;
    to.publish_utc_ns = s.publish_utc_ns;
    to.state = static_cast<std::uint8_t>(s.state);
    to.person = static_cast<std::uint8_t>(s.person);
    to.residual = s.residual;
    for (std::size_t j = 0; j < kRecordJoints; ++j) {
      std::copy_n(s.joints[j].position, 3, to.joints[j].begin());
      to.seen[j] = s.joints[j].seen;
    }
  });
}

void BoothListener::take_status() {
  impl_->take<booth_msg_Status>(impl_->status, [&](const booth_msg_Status& s, const dds_sample_info_t& info) {
    HeardBooth* booth = place(s.booth);
    if (!booth || !info.valid_data) return;
    booth->status_known = true;
    booth->status_utc_ns = s.utc_ns;
    StatusSample& to = booth->status;
    to = {};
    to.state = static_cast<std::uint8_t>(s.state);
    to.degraded = s.degraded, to.paused = s.paused, to.latched = s.emergency_latched;
    to.software = s.software, to.session = s.session, to.alarm = s.alarm;
    for (std::uint32_t i = 0; i < s.faults._length; ++i) to.faults.emplace_back(s.faults._buffer[i].source, s.faults._buffer[i].text);
    for (std::uint32_t i = 0; i < s.cameras._length; ++i) {
      const booth_msg_Camera& c = s.cameras._buffer[i];
      to.cameras.push_back({.name = c.name, .state = c.state, .fps = c.fps, .delivered = c.delivered, .dropped = c.dropped, .restarts = c.restarts});
    }
    to.frames = s.frames, to.groups_dropped = s.groups_dropped;
    to.fps = s.fps, to.latency_p50_ms = s.latency_p50_ms, to.latency_p99_ms = s.latency_p99_ms, to.residual = s.residual;
    to.calibration_age_s = s.calibration_age_s, to.calibration_residual = s.calibration_residual;
    to.disk_free_bytes = s.disk_free_bytes, to.disk_total_bytes = s.disk_total_bytes;
  });
}

}  // namespace booth::daemon
