// Which of several backups of a file is the newest, on a machine whose clock may have been wrong.
#pragma once

#include <filesystem>
#include <vector>

namespace booth::daemon {

/// Oldest first, by when they were written and then by name. One from a time that has yet to come was written while the clock was ahead, and is older than all
/// that were not: else it would be the newest for years.
void sort_backups(std::vector<std::filesystem::path>& backups);

/// Deletes all but the newest `most`, `just_written` always among them. What cannot be deleted stays.
void keep_newest_backups(std::vector<std::filesystem::path> backups, const std::filesystem::path& just_written, std::size_t most);

}  // namespace booth::daemon
