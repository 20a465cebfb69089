// The raw frame log: a short header and FrameRecords as they lie in memory, because only the same program on the same machine reads them again.
#include "daemon/record/session_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <functional>
#include <stdexcept>

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

std::vector<FrameRecord> read_records(const std::filesystem::path& path, const Read& read) {
  Header header;
  const Header expected;
  if (!read(&header, sizeof header) || std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0)
    throw std::runtime_error(fmt::format("{}: is no log of boothd", path.string()));
  if (hal::judge_file_version(header.version, kFrameLogVersion) == hal::FileVersion::unreadable)
    throw OtherLogVersion(fmt::format("{}: {}", path.string(), hal::file_version_complaint(header.version, kFrameLogVersion)));
  if (header.record_bytes < kFirstRecord || header.record_bytes > kLargestRecord ||
      (header.version == kFrameLogVersion && header.record_bytes != sizeof(FrameRecord)))
    throw std::runtime_error(fmt::format("{}: its frames are of {} bytes, which no version writes", path.string(), header.record_bytes));
  std::vector<FrameRecord> out;
  std::vector<char> stored(header.record_bytes);
  while (read(stored.data(), stored.size())) {
    FrameRecord record;
    std::memcpy(static_cast<void*>(&record), stored.data(), std::min(stored.size(), sizeof record));
    // A block that was never written reads as zeros after a power cut; frames count from zero without gaps.
    if (!out.empty() && record.sequence <= out.back().sequence) break;
    if (record.shape_count > kRecordShape || record.captured_ns == 0) break;
    out.push_back(record);
  }
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
  lost_ = 0;
  stop_ = false;
  open_ = true;
  thread_ = std::thread([this] { run(); });
}

void SessionLog::append(const FrameRecord& record) noexcept {
  if (open_.load(std::memory_order_acquire) && !ring_->push(record)) lost_.fetch_add(1, std::memory_order_relaxed);
}

bool SessionLog::drain() {
  FrameRecord record;
  while (ring_->pop(record)) {
    if (!problem_.empty()) {
      lost_.fetch_add(1, std::memory_order_relaxed);
    } else if (!put(&record, sizeof record)) {
      problem_ = fmt::format("the session's frames cannot be written: {}", std::strerror(errno));
      lost_.fetch_add(1, std::memory_order_relaxed);
    }
  }
  return problem_.empty();
}

void SessionLog::run() {
  ::pthread_setname_np(::pthread_self(), "frame-log");
  // A second between writes: what a power cut may cost, and few wake-ups.
  for (int turn = 0; !stop_; ++turn) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (drain() && turn % 20 == 0) (void)::fdatasync(fd_);
  }
  drain();
}

void SessionLog::close() {
  if (!open_) return;
  open_ = false;
  stop_ = true;
  thread_.join();
  const bool ended = !problem_.empty() || !encoder_ || put(nullptr, 0, true);
  if ((!ended || ::fsync(fd_) != 0) && problem_.empty()) problem_ = fmt::format("the session's frames cannot be written: {}", std::strerror(errno));
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
    auto out = read_records(folder / (std::string(kSealedFrameLogName) + kSealedEnding), read);
    if (complaint) *complaint = in.complaint();
    return out;
  }
  const auto path = folder / kFrameLogName;
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(fmt::format("{}: there is no log of frames that could be read", path.string()));
  return read_records(path,
                      [&](void* to, std::size_t count) { return static_cast<bool>(in.read(static_cast<char*>(to), static_cast<std::streamsize>(count))); });
}

}  // namespace booth::daemon
