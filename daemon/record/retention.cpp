// The folder's name is its date: no clock of the file system is asked.
#include "daemon/record/retention.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <fstream>
#include <mutex>
#include <tuple>

#include "daemon/io/atomic_file.hpp"
#include "daemon/record/clock_belief.hpp"
#include "daemon/seal/seal.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

std::tm utc_calendar(std::int64_t utc_ns) {
  const std::time_t s = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm out{};
  ::gmtime_r(&s, &out);
  return out;
}

bool dated(const std::string& name) {
  if (name.size() < 17 || name[8] != 'T' || name[15] != 'Z' || name[16] != '-') return false;
  for (std::size_t i = 0; i < 15; ++i)
    if (i != 8 && (name[i] < '0' || name[i] > '9')) return false;
  return true;
}

std::uintmax_t folder_bytes(const fs::path& folder) {
  std::uintmax_t sum = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored) && !it->is_symlink(ignored)) sum += it->file_size(ignored);
  }
  return sum;
}

constexpr const char* kAheadName = ".ahead";

std::string stamp(std::int64_t utc_ns) { return fmt::format("{:%Y%m%dT%H%M%SZ}", utc_calendar(std::max<std::int64_t>(0, utc_ns))); }

/// The date from which a folder's age counts: that of its name, unless that has yet to come. A clock that was ahead must not keep people's measurements for
/// years, nor one that was set back delete today's: then it counts from when it was first seen so, which a file in the folder remembers.
std::string age_from(const fs::path& folder, std::int64_t now_utc_ns) {
  const std::string named = folder.filename().string().substr(0, 16), tomorrow = stamp(now_utc_ns + 86'400'000'000'000);
  if (named <= tomorrow) return named;
  std::string since;
  std::ifstream(folder / kAheadName) >> since;
  if (since.size() == 16 && dated(since + "-") && since <= tomorrow) return since;
  since = stamp(now_utc_ns);
  try {
    write_file_atomically(folder / kAheadName, since + "\n", 0600);
  } catch (const std::exception&) {  // a full disk; the next look will do
  }
  return since;
}

/// False with errno when it could not be done.
bool overwrite(const fs::path& file, std::uintmax_t size) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  if (fd < 0) return false;
  const std::string zeros(1 << 16, '\0');
  bool good = true;
  for (std::uintmax_t done = 0; good && done < size;) {
    const ssize_t n = ::write(fd, zeros.data(), static_cast<std::size_t>(std::min<std::uintmax_t>(zeros.size(), size - done)));
    if (n < 0 && errno == EINTR) continue;
    good = n > 0;
    if (good) done += static_cast<std::uintmax_t>(n);
  }
  good = ::fsync(fd) == 0 && good;
  ::close(fd);
  return good;
}

}  // namespace

std::string erase_folder(const fs::path& folder) {
  std::vector<std::pair<std::uintmax_t, fs::path>> files;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->is_symlink(ignored) || !it->is_regular_file(ignored)) continue;
    files.emplace_back(it->file_size(ignored), it->path());
  }
  // The key of a sealed folder first: without it the rest is noise, should anything of it be left.
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) {
    const auto rank = [](const auto& f) { return std::tuple(f.second.filename() != kSealKeyName, f.first, f.second); };
    return rank(a) < rank(b);
  });
  for (const auto& [size, path] : files) {
    // What cannot be overwritten (a full disk that writes elsewhere) is deleted all the same: gone by name is better than not gone.
    (void)overwrite(path, size);
    if (::unlink(path.c_str()) != 0) return fmt::format("{}: {}", path.string(), std::strerror(errno));
  }
  std::error_code removal;
  fs::remove_all(folder, removal);
  if (removal) return fmt::format("{}: {}", folder.string(), removal.message());
  return {};
}

std::vector<std::string> prune_folders(const fs::path& directory, const RetentionRule& rule, std::int64_t now_utc_ns) {
  std::vector<std::string> said;
  // A session's beginning and the housekeeper may both come; two at work would each count what the other deletes, and delete too much. The first one is enough.
  static std::mutex one_at_a_time;
  const std::unique_lock lock(one_at_a_time, std::try_to_lock);
  if (!lock) return said;
  std::vector<fs::path> folders;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->is_directory(ignored) && !it->is_symlink(ignored) && dated(it->path().filename().string())) folders.push_back(it->path());
  }
  struct Aged {
    std::string since;
    fs::path folder;
    std::uintmax_t bytes;
    bool operator<(const Aged& other) const { return std::tie(since, folder) < std::tie(other.since, other.folder); }
  };
  std::vector<Aged> aged;
  std::uintmax_t total = 0;
  for (const auto& folder : folders) total += aged.emplace_back(Aged{age_from(folder, now_utc_ns), folder, folder_bytes(folder)}).bytes;
  std::sort(aged.begin(), aged.end());
  const bool by_age = rule.max_age_days > 0 && clock_believed(directory, now_utc_ns);
  const std::string oldest_kept = rule.max_age_days > 0 ? stamp(now_utc_ns - rule.max_age_days * 86'400'000'000'000) : std::string();
  int doubtful = 0;
  for (const auto& [since, folder, bytes] : aged) {
    const std::string id = folder.filename().string();
    const bool old = !oldest_kept.empty() && since < oldest_kept;
    if (old && !by_age) ++doubtful;
    const bool over = rule.quota_bytes > 0 && total > static_cast<std::uintmax_t>(rule.quota_bytes);
    if (!(old && by_age) && !over) continue;
    if (!rule.deletable(folder)) continue;
    if (const std::string problem = erase_folder(folder); !problem.empty()) {
      said.push_back(fmt::format("{} {} should be deleted, but cannot be: {}", rule.what, id, problem));
    } else {
      total -= bytes;
      said.push_back(fmt::format("{} {} was deleted: {}", rule.what, id, old ? "older than " + rule.age_key : "more than " + rule.size_key));
    }
  }
  if (doubtful > 0)
    said.push_back(fmt::format("the clock leapt by more than {} days: {} {}s would be {} now and are kept for a day, in case that it is wrong", kClockLeapDays,
                               doubtful, rule.what, "older than " + rule.age_key));
  return said;
}

std::vector<std::string> prune_recordings(const fs::path& directory, std::int64_t quota_bytes, std::int64_t max_age_days, std::int64_t now_utc_ns,
                                          const std::function<bool(const std::string& name)>& in_work) {
  const RetentionRule rule{.what = "recording",
                           .age_key = "record.max_age_days",
                           .size_key = "record.quota_bytes",
                           .quota_bytes = quota_bytes,
                           .max_age_days = max_age_days,
                           .deletable = [&](const fs::path& folder) {
                             const std::string name = folder.filename().string();
                             return !in_work(name.substr(0, name.rfind(".partial-")));
                           }};
  return prune_folders(directory, rule, now_utc_ns);
}

}  // namespace booth::daemon
