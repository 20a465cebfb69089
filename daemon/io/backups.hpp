// Which of several backups of a file is the newest, on a machine whose clock may have been wrong.
#pragma once

#include <filesystem>
#include <vector>

namespace booth::daemon {

/// Oldest first, by the time that the file itself has and then by name.
void sort_backups(std::vector<std::filesystem::path>& backups);

/// Deletes all but the newest `most`, `just_written` always among them: it becomes the newest, with a time behind the others' where the clock gave it none, so
/// that a clock that was ahead does not win for years. What cannot be deleted stays.
void keep_newest_backups(std::vector<std::filesystem::path> backups, const std::filesystem::path& just_written, std::size_t most);

}  // namespace booth::daemon
