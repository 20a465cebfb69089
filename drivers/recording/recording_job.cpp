// The only thread that waits for the disk; when the disk is too slow, moments are overtaken in memory and counted, and nobody else notices.
#include "drivers/recording/recording_job.hpp"

#include <pthread.h>
#include <sys/statvfs.h>

#include <cstring>
#include <stdexcept>

#include "drivers/recording/recording_sink.hpp"
#include "drivers/recording/text.hpp"

namespace booth::drivers {

using namespace std::chrono_literals;

RecordingJob::RecordingJob(const RecordingContext& context, RecordingOrder order) : context_(context), order_(std::move(order)), began_(context.clock.now()) {
  status_.path = order_.path.string();
  status_.running = true;
  status_.depth = order_.depth;
  asked();
  thread_ = std::thread([this] { run(); });
}

RecordingJob::~RecordingJob() {
  stop_ = true;
  thread_.join();
}

hal::RecordingStatus RecordingJob::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void RecordingJob::run() {
  ::pthread_setname_np(::pthread_self(), "record-disk");
  std::string problem;
  try {
    write();
  } catch (const std::exception& e) {
    problem = e.what();
  }
  {
    const std::lock_guard lock(mutex_);
    if (!problem.empty()) status_.problem = problem;
    status_.running = false;
  }
  running_.store(false, std::memory_order_release);
}

std::string RecordingJob::over(hal::MonotonicTime now) const {
  if (stop_) return "stopped";
  if (now - began_ >= hal::from_seconds(order_.seconds)) return "time";
  if (order_.patience.count() > 0 && now.time_since_epoch() - hal::Nanoseconds(asked_ns_.load()) > order_.patience) return "nobody asked after it any more";
  return {};
}

void RecordingJob::check_space(const std::filesystem::path& folder) const {
  struct statvfs disk {};
  if (::statvfs(folder.c_str(), &disk) != 0) return;
  const auto free = static_cast<std::uint64_t>(disk.f_bavail) * disk.f_frsize;
  if (free < context_.keep_free_bytes)
    throw std::runtime_error("the disk of " + folder.parent_path().string() + " has " + std::to_string(free >> 20) +
                             " MB left, less than record.keep_free_bytes");
}

void RecordingJob::write() {
  const auto sink = make_recording_sink(order_.path, context_.cameras, context_.background,
                                        {.compressed = !order_.uncompressed, .depth = order_.depth, .groups = true}, context_.seal);
  // One offset for the whole recording: differences between its stamps are those of the monotonic clock, whatever is done to the wall clock meanwhile.
  const hal::Nanoseconds offset = context_.clock.utc_now().time_since_epoch() - context_.clock.now().time_since_epoch();
  const auto utc = [&](hal::MonotonicTime t) { return hal::UtcTime(t.time_since_epoch() + offset); };
  const auto note = [&](const std::string& text) { return "{\"kind\":\"recording\",\"source\":\"recorder\",\"text\":" + json_text(text) + "}"; };
  MomentRing::Cursor cursor = order_.from;
  Moment moment;
  std::vector<std::byte> bytes;
  std::uint64_t missed = 0, frames = 0;
  // What a snapshot shows lies behind the moment at which it was asked for.
  std::optional<hal::MonotonicTime> earliest;
  hal::MonotonicTime latest{};
  auto next_look = std::chrono::steady_clock::now();
  std::optional<std::uint64_t> until = order_.until;
  std::string end = until ? "complete" : "";
  try {
    check_space(sink->folder());
    sink->event(note("begins: " + order_.reason), utc(began_));
    while (true) {
      const hal::MonotonicTime now = context_.clock.now();
      // What was handed in before the end belongs to the recording: first the end, then what is there.
      if (!until && !(end = over(now)).empty()) {
        context_.settle();
        until = context_.ring.next().number;
      }
      const bool got = (!until || cursor.number < *until) && context_.ring.read(cursor, moment, bytes, missed);
      if (got) earliest = std::min(earliest.value_or(moment.time), moment.time), latest = std::max(latest, moment.time);
      if (got && moment.kind == Moment::Kind::depth && order_.depth) {
        sink->depth(moment.camera, bytes, utc(moment.time));
        ++frames;
      } else if (got && moment.kind == Moment::Kind::group) {
        hal::FittedGroup group;
        std::memcpy(&group, bytes.data(), std::min(sizeof group, bytes.size()));
        sink->group(group, offset);
      } else if (got && moment.kind == Moment::Kind::event) {
        sink->event(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()), utc(moment.time));
      }
      if (const auto here = std::chrono::steady_clock::now(); here >= next_look || !got) {
        const std::lock_guard lock(mutex_);
        status_.seconds = !order_.until ? hal::seconds(now - began_) : earliest ? hal::seconds(latest - *earliest) : 0.0;
        status_.frames = frames;
        status_.missed = missed;
        status_.bytes = sink->bytes();
        if (here >= next_look) check_space(sink->folder());
        if (here >= next_look) next_look = here + 500ms;
      }
      if (got) continue;
      if (until) break;
      sink->commit_if_due();
      std::this_thread::sleep_for(10ms);
    }
    sink->event(note("ends: " + end + "; " + std::to_string(missed) + " moments missed"), utc(context_.clock.now()));
    sink->close();
  } catch (const std::exception& e) {
    // What was written before is worth keeping; a bag that cannot even be closed is finished at the next start.
    const std::string why = e.what();
    sink->give_up_last();
    try {
      sink->close();
    } catch (const std::exception&) {
      throw std::runtime_error(why + "; what was written is in " + sink->folder().string());
    }
    throw std::runtime_error(why + "; what was written before is in " + order_.path.string());
  }
}

}  // namespace booth::drivers
