// The raw frame log: a short header and FrameRecords as they lie in memory, because only the same program on the same machine reads them again.
#include "daemon/record/session_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <utility>

#include "daemon/io/atomic_file.hpp"
#include "daemon/seal/sealed_file.hpp"
#include "hal/file_version.hpp"

namespace booth::daemon {
namespace {

/// A later version may append to FrameRecord, and raises both numbers; nothing in it ever moves, so that each reads what its neighbours wrote.
struct Header {
  char magic[8] = {'b', 'o', 'o', 't', 'h', 'l', 'o', 'g'};
  std::uint32_t version = kFrameLogVersion;
  std::uint32_t record_bytes = sizeof(FrameRecord);
};
constexpr std::uint32_t kFirstRecord = 2456, kLargestRecord = 1 << 16;
// Nanoseconds between two frames. No session lasts longer than four hours; and a last frame that comes hours after all others is a time that has rotted.
constexpr std::int64_t kLongestGap = 14'400'000'000'000, kLongestGapAtEnd = 3'600'000'000'000;
static_assert(sizeof(FrameRecord) >= kFirstRecord && offsetof(FrameRecord, q) == 72 && offsetof(FrameRecord, reserved) == kFirstRecord - 1,
              "what version 1 wrote lies elsewhere: such a log cannot be read any more");

bool write_all(int fd, const void* data, std::size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(fd, at, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    size -= static_cast<std::size_t>(n);
  }
  return true;
}

using Read = std::function<bool(void* to, std::size_t count)>;  ///< false: there is less

/// Whether boothd can have written this. A block that was never written reads as zeros after a power cut, and storage rots; one such record must not make a
/// file of the whole session that nobody can read, or that is as long as its false time says.
bool possible(const FrameRecord& r) {
  if (r.captured_ns <= 0 || r.shape_count > kRecordShape || r.person > PersonState::tracked || r.sex > RecordSex::women) return false;
  const auto small = [](double v) { return std::abs(v) < 1e6; };  // false of what is no number
  if (!small(static_cast<double>(r.residual)) || !std::all_of(r.q.begin(), r.q.end(), small)) return false;
  if (!std::all_of(r.beta.begin(), r.beta.begin() + r.shape_count, [](double b) { return std::abs(b) < 100; })) return false;
  return std::all_of(r.joints.begin(), r.joints.end(), [&](const auto& joint) { return std::all_of(joint.begin(), joint.end(), small); });
}

bool follows(const FrameRecord& a, const FrameRecord& b, std::int64_t longest = kLongestGap) {
  return b.sequence > a.sequence && b.captured_ns > a.captured_ns && b.captured_ns - a.captured_ns <= longest;
}

/// Leaves out whatever does not fit between its neighbours: number and time only ever grow. Where two do not go together, the later one is right if it goes
/// with what came before.
void keep_what_fits(std::vector<FrameRecord>& records) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const auto later = [&](std::size_t step) { return i + step < records.size() ? &records[i + step] : nullptr; };
    const FrameRecord *next = later(1), *last = kept > 0 ? &records[kept - 1] : nullptr;
    bool fits = !last || follows(*last, records[i], next ? kLongestGap : kLongestGapAtEnd);
    if (fits && next && !follows(records[i], *next)) fits = last ? !follows(*last, *next) : later(2) && follows(records[i], *later(2));
    if (fits) records[kept++] = records[i];
  }
  records.resize(kept);
}

std::vector<FrameRecord> read_records(const std::filesystem::path& path, const Read& read, std::string* complaint) {
  Header header;
  const Header expected;
  std::string damaged_head;  // how
  if (!read(&header, sizeof header) || std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0)
    damaged_head = "is no log of boothd";
  else if (header.version == kFrameLogVersion && header.record_bytes != sizeof(FrameRecord))
    damaged_head = fmt::format("its frames are of {} bytes, which no version writes", header.record_bytes);
  // One byte that rotted there must not cost what follows: where the records are ours the head was, too.
  if (!damaged_head.empty()) header = expected;
  if (hal::judge_file_version(header.version, kFrameLogVersion) == hal::FileVersion::unreadable)
    throw OtherLogVersion(fmt::format("{}: {}", path.string(), hal::file_version_complaint(header.version, kFrameLogVersion)));
  if (header.record_bytes < kFirstRecord || header.record_bytes > kLargestRecord)
    throw std::runtime_error(fmt::format("{}: its frames are of {} bytes, which no version writes", path.string(), header.record_bytes));
  std::vector<FrameRecord> out;
  std::vector<char> stored(header.record_bytes);
  std::uint64_t found = 0;
  for (; read(stored.data(), stored.size()); ++found) {
    FrameRecord record;
    std::memcpy(static_cast<void*>(&record), stored.data(), std::min(stored.size(), sizeof record));
    if (possible(record)) out.push_back(record);
  }
  keep_what_fits(out);
  if (!damaged_head.empty() && 2 * out.size() <= found) throw std::runtime_error(fmt::format("{}: {}", path.string(), damaged_head));
  if (complaint && !damaged_head.empty()) *complaint = fmt::format("{}: its head is damaged", path.string());
  if (complaint && out.size() < found)
    *complaint = fmt::format("{}: {} of its {} frames are damaged and were left out", path.string(), found - out.size(), found);
  return out;
}

}  // namespace

SessionLog::SessionLog() : ring_(std::make_unique<Ring>()) {}

SessionLog::~SessionLog() { close(); }

bool SessionLog::put(const void* data, std::size_t size, bool last) {
  if (!encoder_) return write_all(fd_, data, size);
  sealed_.clear();
  encoder_->append({static_cast<const char*>(data), size}, last, sealed_);
  return write_all(fd_, sealed_.data(), sealed_.size());
}

void SessionLog::open(const std::filesystem::path& folder, const Seal* seal) {
  close();
  const auto path = folder / (seal ? std::string(kSealedFrameLogName) + kSealedEnding : std::string(kFrameLogName));
  encoder_ = seal ? std::make_unique<SealEncoder>(*seal, kSealedFrameLogName) : nullptr;
  fd_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  const Header header;
  // The log's name has to outlive a power cut as its frames do, which are brought to the disk every second.
  const bool good = fd_ >= 0 && put(&header, sizeof header) && (errno = sync_folder(folder)) == 0;
  if (!good) {
    const std::string reason = std::strerror(errno);
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
    throw std::runtime_error(fmt::format("{}: cannot be written: {}", path.string(), reason));
  }
  problem_.clear();
  lost_ = written_ = 0;
  stop_ = broken_ = full_ = false;
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::exception& e) {
    ::close(std::exchange(fd_, -1));
    throw std::runtime_error(fmt::format("{}: has no thread to write it: {}", path.string(), e.what()));
  }
  open_ = true;
}

void SessionLog::append(const FrameRecord& record) noexcept {
  if (open_.load(std::memory_order_acquire) && !ring_->push(record)) lost_.fetch_add(1, std::memory_order_relaxed);
}

bool SessionLog::drain() {
  FrameRecord record;
  while (ring_->pop(record)) {
    if (!full_ && put(&record, sizeof record)) {
      ++written_;
      continue;
    }
    if (!full_) fail(errno);
    full_ = true;
    lost_.fetch_add(1, std::memory_order_relaxed);
  }
  return !full_;
}

void SessionLog::fail(int reason) {
  if (broken_) return;  // the first reason is the one that counts
  problem_ = fmt::format("the session's frames cannot be written: {}", std::strerror(reason));
  broken_.store(true, std::memory_order_release);
}

void SessionLog::run() {
  ::pthread_setname_np(::pthread_self(), "frame-log");
  // A second between writes: what a power cut may cost, and few wake-ups.
  for (int turn = 0; !stop_; ++turn) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    // Told once and never again: an fsync after one that failed says that all is well. Frames are written on, some of them may arrive.
    if (drain() && turn % 20 == 0 && ::fdatasync(fd_) != 0 && errno != EINVAL && errno != EINTR) fail(errno);
  }
  drain();
}

void SessionLog::close() {
  if (!open_) return;
  open_ = false;
  stop_ = true;
  thread_.join();
  const bool ended = full_ || !encoder_ || put(nullptr, 0, true);
  if (!ended || ::fsync(fd_) != 0) fail(errno);
  ::close(fd_);
  fd_ = -1;
  encoder_.reset();
}

std::uint64_t session_log_records(std::uint64_t bytes) { return bytes < sizeof(Header) ? 0 : (bytes - sizeof(Header)) / sizeof(FrameRecord); }

std::vector<FrameRecord> read_session_log(const std::filesystem::path& folder, const Seal* seal, std::string* complaint) {
  if (seal) {
    SealedReader in(folder, kSealedFrameLogName, *seal);
    std::string plain, chunk;
    if (in.next(chunk)) {
      plain = chunk;
    } else if (in.end() == SealEnd::cut) {  // interrupted before anything was in it
      if (complaint) *complaint = in.complaint();
      return {};
    } else {
      throw std::runtime_error(in.complaint());
    }
    const auto read = [&](void* to, std::size_t count) {
      while (plain.size() < count && in.next(chunk)) plain += chunk;
      if (plain.size() < count) return false;
      std::memcpy(to, plain.data(), count);
      plain.erase(0, count);
      return true;
    };
    auto out = read_records(folder / (std::string(kSealedFrameLogName) + kSealedEnding), read, complaint);
    if (complaint && !in.complaint().empty()) *complaint = in.complaint();
    return out;
  }
  const auto path = folder / kFrameLogName;
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(path.c_str(), "rbe"), &std::fclose);
  if (!in && errno != ENOENT) throw LogOutOfReach(fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(errno)));
  if (!in) throw std::runtime_error(fmt::format("{}: there is no log of frames", path.string()));
  int failed = 0;
  const auto read = [&](void* to, std::size_t count) {
    if (std::fread(to, 1, count, in.get()) == count) return true;
    if (std::ferror(in.get()) != 0) failed = errno;
    return false;
  };
  auto out = read_records(path, read, complaint);
  // A disk with a bad sector: what came before it is good.
  if (complaint && failed != 0) *complaint = fmt::format("{}: can be read no further than frame {}: {}", path.string(), out.size(), std::strerror(failed));
  return out;
}

}  // namespace booth::daemon
