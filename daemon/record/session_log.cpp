// The raw frame log: a short header and FrameRecords as they lie in memory, because only the same program on the same machine reads them again.
#include "daemon/record/session_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace booth::daemon {
namespace {

struct Header {
  char magic[8] = {'b', 'o', 'o', 't', 'h', 'l', 'o', 'g'};
  std::uint32_t version = 1;
  std::uint32_t record_bytes = sizeof(FrameRecord);
};

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

}  // namespace

SessionLog::SessionLog() : ring_(std::make_unique<Ring>()) {}

SessionLog::~SessionLog() { close(); }

void SessionLog::open(const std::filesystem::path& folder) {
  close();
  const auto path = folder / kFrameLogName;
  fd_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  const Header header;
  if (fd_ < 0 || !write_all(fd_, &header, sizeof header)) {
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
    } else if (!write_all(fd_, &record, sizeof record)) {
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
  if (::fsync(fd_) != 0 && problem_.empty()) problem_ = fmt::format("the session's frames cannot be written: {}", std::strerror(errno));
  ::close(fd_);
  fd_ = -1;
}

std::vector<FrameRecord> read_session_log(const std::filesystem::path& folder) {
  const auto path = folder / kFrameLogName;
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(fmt::format("{}: there is no log of frames that could be read", path.string()));
  Header header;
  const Header expected;
  in.read(reinterpret_cast<char*>(&header), sizeof header);
  if (!in || std::memcmp(&header, &expected, sizeof header) != 0)
    throw std::runtime_error(fmt::format("{}: not a log of this version of boothd", path.string()));
  std::vector<FrameRecord> out;
  for (FrameRecord record; in.read(reinterpret_cast<char*>(&record), sizeof record);) {
    // A block that was never written reads as zeros after a power cut; frames count from zero without gaps.
    if (!out.empty() && record.sequence <= out.back().sequence) break;
    if (record.shape_count > kRecordShape || record.captured_ns == 0) break;
    out.push_back(record);
  }
  return out;
}

}  // namespace booth::daemon
