// Takes frames from the fit thread and puts them on disk, so that a power cut costs at most the last moments.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "daemon/pipeline/index_ring.hpp"

namespace booth::daemon {

/// Name of the raw log inside a session folder that has not been finished, and of one that was damaged, once what can be read of it is saved.
inline constexpr const char* kFrameLogName = ".frames.part";
inline constexpr const char* kDamagedLogName = "frames.damaged";
/// The same of a sealed session, without ".sealed". It stays where boothd could not finish the session, because only the key's holder can.
inline constexpr const char* kSealedFrameLogName = "frames.log";

/// What this program writes into a raw log's head.
inline constexpr std::uint32_t kFrameLogVersion = 1;

class Seal;
class SealEncoder;

/// Frames go through a fixed ring to a writer thread; memory is taken at construction.
class SessionLog {
 public:
  SessionLog();
  ~SessionLog();
  SessionLog(const SessionLog&) = delete;

  /// Begins the raw log in an existing folder; sealed where a seal is given, record by record. Throws std::runtime_error naming the path and the system's
  /// reason.
  void open(const std::filesystem::path& folder, const Seal* seal = nullptr);
  /// Called by one thread. Returns at once; a frame that finds the ring full is counted as lost.
  void append(const FrameRecord& record) noexcept;
  /// Writes what is left, flushes to stable storage. No append() may run at the same time. Harmless when not open.
  void close();

  /// Frames that did not reach the disk since open(): the ring was full, or the disk was.
  std::uint64_t lost() const { return lost_.load(); }
  /// Whether writing has failed: nothing more reaches the disk, or nobody knows whether it did. Any thread may ask.
  bool broken() const { return broken_.load(std::memory_order_acquire); }
  /// Why, empty while it works. Valid after close(), and once broken().
  const std::string& problem() const { return problem_; }
  /// Frames that were handed to the disk since open(). Valid after close().
  std::uint64_t written() const { return written_; }
  static std::size_t memory_bytes() { return sizeof(Ring); }

 private:
  using Ring = IndexRing<FrameRecord, 128>;  // four seconds at 30 frames/s: longer than a disk usually pauses
  void run();
  bool drain();
  bool put(const void* data, std::size_t size, bool last = false);
  void fail(int reason);

  std::unique_ptr<Ring> ring_;
  std::unique_ptr<SealEncoder> encoder_;
  std::string sealed_;
  int fd_ = -1;
  std::atomic<bool> open_{false}, stop_{false}, broken_{false};
  std::atomic<std::uint64_t> lost_{0};
  std::uint64_t written_ = 0;
  bool full_ = false;    ///< a write has failed: what follows would stand behind half a record
  std::string problem_;  ///< written once, before broken_ is set
  std::thread thread_;
};

/// A log that is whole, perhaps, but for another boothd to read.
struct OtherLogVersion : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A log that could not be opened now, for want of memory, descriptors or rights; it may be whole.
struct LogOutOfReach : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// How many records a log of so many plain bytes holds.
std::uint64_t session_log_records(std::uint64_t bytes);

/// Reads the raw log of `folder`; a record torn by a power cut is left out, and so is a damaged one. Throws std::runtime_error when there is none
/// that could be boothd's, LogOutOfReach, and OtherLogVersion when it is of neither this version nor a neighbour's (hal/file_version.hpp). How many were
/// damaged is put into `complaint`; with a seal the sealed log is read, and there what is wrong with its end, which an interruption explains.
std::vector<FrameRecord> read_session_log(const std::filesystem::path& folder, const Seal* seal = nullptr, std::string* complaint = nullptr);

}  // namespace booth::daemon
