// A writer, two readers, and the booth's clock.
#include "daemon/dds/command_client.hpp"

#include <dds/dds.h>
#include <fmt/format.h>

#include <optional>
#include <random>
#include <stdexcept>
#include <thread>

#include "booth.h"
#include "daemon/dds/booth_listener.hpp"
#include "daemon/dds/bounded_text.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"

namespace booth::daemon {
namespace {

using Clock = std::chrono::steady_clock;

std::uint64_t random_number() {
  std::random_device random;
  return (static_cast<std::uint64_t>(random()) << 32) | random();
}

/// Takes what has come and lets `look` see it.
template <class T, class F>
void take_all(dds_entity_t reader, F look) {
  void* samples[1] = {nullptr};
  dds_sample_info_t info[1];
  while (dds_take(reader, samples, info, 1, 1) == 1) {
    if (info[0].valid_data) look(*static_cast<const T*>(samples[0]));
    (void)dds_return_loan(reader, samples, 1);
    samples[0] = nullptr;
  }
}

dds_entity_t make_command_writer(const DdsSettings& settings, const DdsParticipant& dds) {
  try {
    return make_writer(dds.participant(), dds.publisher(), DdsTopic::command);
  } catch (const std::exception&) {
    if (!settings.secured) throw;
    throw std::runtime_error(fmt::format("these credentials may not command booth {}; a console's may (`boothctl security issue ... console NAME --booths {}`)",
                                         settings.booth, settings.booth));
  }
}

}  // namespace

struct CommandClient::Impl {
  explicit Impl(const DdsSettings& s)
      : settings(s),
        dds(s),
        writer(make_command_writer(s, dds)),
        replies(make_reader(dds.participant(), dds.subscriber(), DdsTopic::reply)),
        status(make_reader(dds.participant(), dds.subscriber(), DdsTopic::status)),
        sender(fmt::format("boothctl-{:016x}", random_number())) {}

  bool matched() const {
    dds_publication_matched_status_t there{};
    dds_subscription_matched_status_t back{};
    return dds_get_publication_matched_status(writer, &there) == 0 && there.current_count > 0 && dds_get_subscription_matched_status(replies, &back) == 0 &&
           back.current_count > 0;
  }

  /// The booth's clock now, by its last status; nothing before the first.
  std::optional<std::int64_t> booth_utc_ns() {
    take_all<booth_msg_Status>(status, [&](const booth_msg_Status& s) {
      if (settings.booth != s.booth) return;
      heard = true;
      status_utc_ns = s.utc_ns;
      status_came = Clock::now();
    });
    if (!heard) return std::nullopt;
    return status_utc_ns + std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - status_came).count();
  }

  DdsSettings settings;
  DdsParticipant dds;
  dds_entity_t writer, replies, status;
  std::string sender;
  bool heard = false;
  std::int64_t status_utc_ns = 0;
  Clock::time_point status_came{};
};

CommandClient::CommandClient(const DdsSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
CommandClient::~CommandClient() = default;

CommandAnswer CommandClient::send(DdsCommand command, std::chrono::milliseconds limit) {
  Impl& me = *impl_;
  const auto end = Clock::now() + limit;
  booth_msg_Command sample{};
  set_text(sample.booth, me.settings.booth);
  set_text(sample.sender, me.sender);
  sample.version = booth_msg_VERSION;
  sample.id = random_number();
  sample.kind = static_cast<booth_msg_CommandKind>(command);
  std::optional<CommandAnswer> answer;
  for (auto next = Clock::now(); !answer && Clock::now() < end; std::this_thread::sleep_for(std::chrono::milliseconds(5))) {
    const auto now = me.booth_utc_ns();
    if (now && me.matched() && Clock::now() >= next) {
      if (sample.utc_ns == 0) sample.utc_ns = *now;  // the same sample each time, so that it is carried out once
      (void)dds_write(me.writer, &sample);
      next = Clock::now() + std::chrono::seconds(1);
    }
    take_all<booth_msg_Reply>(me.replies, [&](const booth_msg_Reply& r) {
      if (r.id == sample.id && me.sender == r.sender) answer = CommandAnswer{r.accepted, static_cast<std::uint8_t>(r.state), printable(r.text)};
    });
  }
  if (answer) return *answer;
  if (!me.heard)
    throw std::runtime_error(fmt::format("booth {} was not heard; look at the keys dds.* (--set){}", me.settings.booth,
                                         me.settings.secured ? " and at the credentials" : ", and whether the booth wants credentials (--credentials)"));
  throw std::runtime_error(
      fmt::format("booth {} is heard and gave no answer{}", me.settings.booth, me.settings.secured ? "; may these credentials command it?" : ""));
}

}  // namespace booth::daemon
