// metadata.yaml (version 5) and one SQLite file, as ROS 2 writes them; the metadata is always made from what the file holds, so that a bag can be finished by
// whoever finds it.
#include "drivers/recording/bag_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>

#include "drivers/recording/sealed_recording.hpp"

namespace booth::drivers {
namespace {

namespace fs = std::filesystem;

// Latched topics are offered as ROS offers them, so that a player that starts late still gets them.
constexpr const char* kReliable =
    "- history: 1\n  depth: 10\n  reliability: 1\n  durability: 2\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n   "
    " nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false";
constexpr const char* kLatched =
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    "
    "nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false";

constexpr auto kTransaction = std::chrono::seconds(1);

/// Room that is kept on the disk while a bag is written and given back before its last pages and its metadata are: a full disk costs the end, not the bag.
constexpr const char* kReserve = ".reserve";
constexpr std::size_t kReserveBytes = 256 * 1024;

void write_reserve(const fs::path& file) {
  std::ofstream out(file, std::ios::binary);
  const std::string zeros(kReserveBytes, '\0');
  out << zeros;
  out.close();
  if (!out) throw std::runtime_error("cannot write in " + file.parent_path().string() + "; check the disk's space");
}

std::string yaml_quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '\n' ? std::string("\\n") : c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  return out + "\"";
}

std::string text_of(sqlite3_stmt* s, int column) {
  const auto* t = reinterpret_cast<const char*>(sqlite3_column_text(s, column));
  return t == nullptr ? std::string() : std::string(t);
}

[[noreturn]] void damaged(const Database& db, const fs::path& file) { throw std::runtime_error(file.string() + ": " + sqlite3_errmsg(db.get())); }

struct Content {
  std::int64_t messages = 0, first = 0, last = 0;  ///< nanoseconds
  std::map<std::int64_t, std::int64_t> of_topic;   ///< messages
};

/// From the messages themselves: an index that is damaged costs none of them. Throws where they are, so that nobody takes what cannot be read for nothing.
Content content_of(const Database& db, const fs::path& file) {
  Content out;
  const std::int64_t most = bytes_of(db, file) / kLeastRow;
  const Statement all = prepare(db, file, "SELECT topic_id, timestamp FROM messages NOT INDEXED");
  int rc;
  while ((rc = sqlite3_step(all.get())) == SQLITE_ROW) {
    if (++out.messages > most) throw std::runtime_error(file.string() + ": names more messages than it has room for, and is damaged");
    const std::int64_t time = sqlite3_column_int64(all.get(), 1);
    out.first = out.messages == 1 ? time : std::min(out.first, time);
    out.last = out.messages == 1 ? time : std::max(out.last, time);
    ++out.of_topic[sqlite3_column_int64(all.get(), 0)];
  }
  if (rc != SQLITE_DONE) damaged(db, file);
  return out;
}

/// What the file holds, as ROS wants it told.
void write_metadata(const Database& db, const fs::path& file, const fs::path& folder, const Content& content) {
  const std::int64_t total = content.messages, first = content.first, last = content.last;
  const std::string name = file.filename().string();
  std::ofstream out(folder / "metadata.yaml");
  out << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  duration:\n    nanoseconds: " << last - first
      << "\n  starting_time:\n    nanoseconds_since_epoch: " << first << "\n  message_count: " << total << "\n  topics_with_message_count:\n";
  const Statement topics = prepare(db, file, "SELECT name, type, offered_qos_profiles, id FROM topics ORDER BY id");
  int rc;
  while ((rc = sqlite3_step(topics.get())) == SQLITE_ROW) {
    const auto counted = content.of_topic.find(sqlite3_column_int64(topics.get(), 3));
    out << "    - topic_metadata:\n        name: " << text_of(topics.get(), 0) << "\n        type: " << text_of(topics.get(), 1)
        << "\n        serialization_format: cdr\n        offered_qos_profiles: " << yaml_quoted(text_of(topics.get(), 2))
        << "\n      message_count: " << (counted == content.of_topic.end() ? 0 : counted->second) << "\n";
  }
  if (rc != SQLITE_DONE) damaged(db, file);
  out << "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " << name << "\n  files:\n    - path: " << name
      << "\n      starting_time:\n        nanoseconds_since_epoch: " << first << "\n      duration:\n        nanoseconds: " << last - first
      << "\n      message_count: " << total << "\n";
  out.close();
  if (!out) throw std::runtime_error("cannot write " + (folder / "metadata.yaml").string() + "; check the disk's space");
}

}  // namespace

BagFile::BagFile(const fs::path& path)
    : staging_(path),
      file_(staging_.folder() / (staging_.final_path().filename().string() + "_0.db3")),
      db_(open_database(file_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE)),
      committed_(std::chrono::steady_clock::now()) {
  try {
    write_reserve(folder() / kReserve);
    // The journal holds only pages that are written anew: a bag grows, so that is little. It is rolled back when the bag is opened after a crash.
    execute("PRAGMA journal_mode=TRUNCATE");
    execute("PRAGMA synchronous=FULL");
    execute("CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)");
    execute("CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL)");
    execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT "
        "NULL)");
    execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)");
    execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)");
    execute("INSERT INTO schema VALUES (3, 'humble')");
    insert_ = prepare(db_, file_, "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)");
    execute("BEGIN");
  } catch (const std::exception&) {
    std::error_code ignored;
    fs::remove_all(folder(), ignored);  // nothing is in it; a full disk must not gather one for each try
    throw;
  }
}

void BagFile::fail() const { throw std::runtime_error("cannot write " + file_.string() + ": " + sqlite3_errmsg(db_.get()) + "; check the disk's space"); }

void BagFile::execute(const char* sql) {
  if (sqlite3_exec(db_.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) fail();
}

std::size_t BagFile::add_topic(const std::string& name, const std::string& type, bool latched) {
  const Statement same = prepare(db_, file_, "SELECT 1 FROM topics WHERE name = ?");
  sqlite3_bind_text(same.get(), 1, name.c_str(), -1, SQLITE_TRANSIENT);
  if (sqlite3_step(same.get()) == SQLITE_ROW) throw std::runtime_error("two cameras have the same name in ROS ('" + name + "'): rename one");
  const Statement s = prepare(db_, file_, "INSERT INTO topics VALUES (?, ?, ?, 'cdr', ?)");
  sqlite3_bind_int64(s.get(), 1, static_cast<sqlite3_int64>(++topics_));
  sqlite3_bind_text(s.get(), 2, name.c_str(), -1, SQLITE_TRANSIENT);
  sqlite3_bind_text(s.get(), 3, type.c_str(), -1, SQLITE_TRANSIENT);
  sqlite3_bind_text(s.get(), 4, latched ? kLatched : kReliable, -1, SQLITE_STATIC);
  if (sqlite3_step(s.get()) != SQLITE_DONE) fail();
  return topics_;
}

void BagFile::insert(std::size_t topic, hal::UtcTime time, std::span<const char> message) {
  sqlite3_bind_int64(insert_.get(), 1, static_cast<sqlite3_int64>(topic));
  sqlite3_bind_int64(insert_.get(), 2, time.time_since_epoch().count());
  sqlite3_bind_blob64(insert_.get(), 3, message.data(), message.size(), SQLITE_STATIC);
  const int rc = sqlite3_step(insert_.get());
  sqlite3_reset(insert_.get());
  if (rc != SQLITE_DONE) fail();
  ++messages_;
  bytes_ += message.size();
}

void BagFile::commit_if_due() {
  const auto now = std::chrono::steady_clock::now();
  if (now - committed_ < kTransaction) return;
  execute("COMMIT");
  execute("BEGIN");
  committed_ = now;
}

void BagFile::give_up_last_transaction() noexcept {
  std::error_code ignored;
  fs::remove(folder() / kReserve, ignored);
  if (sqlite3_get_autocommit(db_.get()) == 0) sqlite3_exec(db_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
  sqlite3_exec(db_.get(), "BEGIN", nullptr, nullptr, nullptr);
}

void BagFile::close() {
  std::error_code ignored;
  fs::remove(folder() / kReserve, ignored);
  execute("COMMIT");
  insert_.reset();
  write_metadata(db_, file_, folder(), content_of(db_, file_));
  execute("PRAGMA journal_mode=DELETE");
  db_.reset();
  staging_.publish();
}

std::string recover_bag(const fs::path& partial) noexcept {
  const std::string name = partial.filename().string().substr(0, partial.filename().string().rfind(".partial-"));
  try {
    std::error_code ignored;
    fs::remove(partial / kReserve, ignored);
    const fs::path file = partial / (name + "_0.db3");
    std::int64_t messages = 0;
    if (fs::exists(file)) {
      const Database db = open_database(file, SQLITE_OPEN_READWRITE);  // which rolls back what was torn
      distrust(db, file);
      const Content content = content_of(db, file);
      messages = content.messages;
      if (messages > 0) {
        write_metadata(db, file, partial, content);
        sqlite3_exec(db.get(), "PRAGMA journal_mode=DELETE", nullptr, nullptr, nullptr);
      }
    }
    if (messages == 0) {
      fs::remove_all(partial);
      return "recording " + name + " was interrupted before anything was in it; it was removed";
    }
    std::ofstream(partial / "interrupted.txt") << "The process that made this recording ended before the recording did; what it had written is here.\n";
    fs::path target = partial.parent_path() / name;
    if (fs::exists(target)) target = partial.parent_path() / (name + "-recovered-" + partial.filename().string().substr(name.size() + 9));
    Staging::adopt(partial, target);
    return "recording " + name + " was interrupted; " + std::to_string(messages) + " messages of it were saved in " + target.string();
  } catch (const std::exception& e) {
    return "recording " + name + " was interrupted and cannot be finished: " + e.what();
  }
}

std::vector<std::string> recover_bags(const fs::path& directory) {
  std::vector<std::string> said;
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->path().filename().string().find(".partial-") != std::string::npos && it->is_directory(ignored) && !it->is_symlink(ignored))
      found.push_back(it->path());
  }
  std::sort(found.begin(), found.end());
  said.reserve(found.size());
  for (const auto& path : found) said.push_back(is_sealed_recording(path) ? recover_sealed(path) : recover_bag(path));
  return said;
}

}  // namespace booth::drivers
