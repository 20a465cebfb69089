// Token buckets against floods, a window of time against old copies, a memory of what was done against new ones.
#include "daemon/dds/command_guard.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace booth::daemon {
namespace {

/// A copy can be told from the original as long as its time is in the window: from one window before now to one after.
constexpr auto kMemory = std::chrono::nanoseconds(2 * CommandGuard::kWindowNs);
/// What the bucket of all writers lets through in that time, and a little more.
const auto kMostDone = static_cast<std::size_t>(CommandGuard::kAllBurst + CommandGuard::kAllPerSecond * 60) + 20;

}  // namespace

CommandGuard::CommandGuard(std::uint32_t version, hal::MonotonicTime began, CarryOut carry_out, std::function<std::uint8_t()> state)
    : version_(version), began_(began), carry_out_(std::move(carry_out)), state_(std::move(state)) {
  done_.resize(kMostDone);
}

bool CommandGuard::take(Bucket& bucket, double rate, double burst, hal::MonotonicTime now) {
  if (!bucket.used) {
    bucket.used = true;
    bucket.tokens = burst;
  } else {
    bucket.tokens = std::min(burst, bucket.tokens + rate * std::max(0.0, hal::seconds(now - bucket.last)));
  }
  bucket.last = now;
  if (bucket.tokens < 1) return false;
  bucket.tokens -= 1;
  return true;
}

CommandGuard::Bucket& CommandGuard::bucket_of(std::uint64_t writer) {
  Bucket* oldest = &writers_.front();
  for (Bucket& b : writers_) {
    if (b.used && b.writer == writer) return b;
    if (oldest->used && (!b.used || b.last < oldest->last)) oldest = &b;
  }
  *oldest = {};
  oldest->writer = writer;
  return *oldest;
}

std::string CommandGuard::objection(const RemoteCommand& command, std::int64_t utc_ns, hal::MonotonicTime now) const {
  if (command.version != version_) return fmt::format("this booth understands commands of version {}, not {}", version_, command.version);
  if (command.sender.empty()) return "a command needs a sender";
  if (command.kind > static_cast<std::uint32_t>(DdsCommand::snapshot)) return "this command is not known";
  // In floating point: the difference of two hostile 64-bit numbers overflows.
  const double off = static_cast<double>(command.utc_ns) - static_cast<double>(utc_ns);
  if (std::abs(off) > static_cast<double>(kWindowNs))
    return fmt::format("the command's time is {:.0f} s {} the booth's; set the clock, or count from the utc_ns of booth/status", std::abs(off) / 1e9,
                       off < 0 ? "behind" : "before");
  // What was sent before this booth was listening could be a copy of what an earlier run of it has carried out. A clock that was set back since then must not
  // make everything older than that.
  if (command.utc_ns < utc_ns - (now - began_).count()) return "the command is older than this run of boothd";
  return "";
}

std::optional<GuardedAnswer> CommandGuard::handle(const RemoteCommand& command, std::int64_t utc_ns, hal::MonotonicTime now) {
  if (!take(bucket_of(command.writer), kPerSecond, kBurst, now) || !take(all_, kAllPerSecond, kAllBurst, now)) {
    ++ignored_;
    return std::nullopt;
  }
  const auto refuse = [&](std::string text) { return GuardedAnswer{.answer = {.accepted = false, .state = state_(), .text = std::move(text)}}; };
  if (std::string why = objection(command, utc_ns, now); !why.empty()) return refuse(std::move(why));
  for (const Done& d : done_) {
    if (d.sender != command.sender || d.id != command.id || now - d.when > kMemory) continue;
    if (d.kind != command.kind) return refuse("this sender has used this id for another command");
    return GuardedAnswer{.answer = d.answer, .repeated = true};
  }
  Done& done = done_[next_];
  next_ = (next_ + 1) % done_.size();
  done = {.sender = command.sender, .id = command.id, .kind = command.kind, .answer = carry_out_(static_cast<DdsCommand>(command.kind)), .when = now};
  return GuardedAnswer{.answer = done.answer};
}

}  // namespace booth::daemon
