// Ownership of SQLite handles and errors that name the file.
#pragma once

#include <sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

namespace booth::drivers {

struct CloseDatabase {
  void operator()(sqlite3* db) const { sqlite3_close_v2(db); }
};
struct FinaliseStatement {
  void operator()(sqlite3_stmt* s) const { sqlite3_finalize(s); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;
using Statement = std::unique_ptr<sqlite3_stmt, FinaliseStatement>;

inline Database open_database(const std::filesystem::path& path, int flags) {
  sqlite3* raw = nullptr;
  const int rc = sqlite3_open_v2(path.c_str(), &raw, flags, nullptr);
  Database db(raw);
  if (rc != SQLITE_OK) throw std::runtime_error(path.string() + ": " + (db ? sqlite3_errmsg(db.get()) : "SQLite has no memory"));
  return db;
}

inline Statement prepare(const Database& db, const std::filesystem::path& path, const char* sql) {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(db.get(), sql, -1, &raw, nullptr) != SQLITE_OK) throw std::runtime_error(path.string() + ": " + sqlite3_errmsg(db.get()));
  return Statement(raw);
}

/// The whole number that a statement of one row says; throws where it says none, with SQLite's reason.
inline std::int64_t number_of(const Database& db, const std::filesystem::path& path, const char* sql) {
  const Statement s = prepare(db, path, sql);
  if (sqlite3_step(s.get()) != SQLITE_ROW) throw std::runtime_error(path.string() + ": " + sqlite3_errmsg(db.get()));
  return sqlite3_column_int64(s.get(), 0);
}

/// Bytes that a message takes at least, without its data.
constexpr std::int64_t kLeastRow = 8;

/// All its rows together have no more bytes than this, however often a damaged or malicious file counts the same page.
inline std::int64_t bytes_of(const Database& db, const std::filesystem::path& path) {
  return number_of(db, path, "PRAGMA page_count") * number_of(db, path, "PRAGMA page_size");
}

/// For a bag that may be anybody's: what is named like a table has to be one that holds its rows. A view, a virtual table or a column that is computed can go
/// on for ever in a small file, and without a key each look-up reads all of it. Throws std::runtime_error naming the file and what it has instead.
inline void distrust(const Database& db, const std::filesystem::path& path) {
  sqlite3_exec(db.get(), "PRAGMA trusted_schema=off", nullptr, nullptr, nullptr);
  sqlite3_db_config(db.get(), SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_db_config(db.get(), SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(db.get(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  const auto refuse = [&](const std::string& what) { throw std::runtime_error(path.string() + ": " + what + "; it is no bag of ROS, or is damaged"); };
  const auto text = [](const Statement& s, int column) {
    const auto* t = reinterpret_cast<const char*>(sqlite3_column_text(s.get(), column));
    return std::string(t == nullptr ? "" : t);
  };
  const auto each_row = [&](const std::string& sql, auto&& use) {
    const Statement s = prepare(db, path, sql.c_str());
    int rc;
    while ((rc = sqlite3_step(s.get())) == SQLITE_ROW) use(s);
    if (rc != SQLITE_DONE) throw std::runtime_error(path.string() + ": " + sqlite3_errmsg(db.get()));
  };
  for (const std::string name : {"topics", "messages"}) {
    // What SQLite has understood; the text in the file's own list may say anything.
    std::string kind;
    each_row("PRAGMA main.table_list(" + name + ")", [&](const Statement& s) { kind = text(s, 2); });
    if (kind.empty()) refuse("has no table " + name);
    if (kind != "table") refuse(name + " is a " + kind + " and no table");
    bool key = false;
    each_row("PRAGMA main.table_xinfo(" + name + ")", [&](const Statement& s) {
      if (sqlite3_column_int(s.get(), 6) != 0) refuse("column " + text(s, 1).substr(0, 40) + " of " + name + " is computed");
      key = key || (text(s, 1) == "id" && sqlite3_column_int(s.get(), 5) == 1);
    });
    if (!key) refuse("id is not the key of " + name);
  }
}

inline std::span<const std::byte> blob(sqlite3_stmt* s, int column) {
  // The pointer first: asking for the size may convert the value.
  const void* data = sqlite3_column_blob(s, column);
  return {static_cast<const std::byte*>(data), data == nullptr ? 0 : static_cast<std::size_t>(sqlite3_column_bytes(s, column))};
}

}  // namespace booth::drivers
