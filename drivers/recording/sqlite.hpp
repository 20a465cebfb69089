// Ownership of SQLite handles and errors that name the file.
#pragma once

#include <sqlite3.h>

#include <cstddef>
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

/// For a file that may be anybody's: what is named like a table has to be one, since a view can compute for ever.
inline void distrust(const Database& db) {
  sqlite3_exec(db.get(), "PRAGMA trusted_schema=off", nullptr, nullptr, nullptr);
  sqlite3_db_config(db.get(), SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_db_config(db.get(), SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(db.get(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
}

inline Statement prepare(const Database& db, const std::filesystem::path& path, const char* sql) {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(db.get(), sql, -1, &raw, nullptr) != SQLITE_OK) throw std::runtime_error(path.string() + ": " + sqlite3_errmsg(db.get()));
  return Statement(raw);
}

inline std::span<const std::byte> blob(sqlite3_stmt* s, int column) {
  // The pointer first: asking for the size may convert the value.
  const void* data = sqlite3_column_blob(s, column);
  return {static_cast<const std::byte*>(data), data == nullptr ? 0 : static_cast<std::size_t>(sqlite3_column_bytes(s, column))};
}

}  // namespace booth::drivers
