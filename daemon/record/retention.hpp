// What is deleted when: folders whose names begin with their date, oldest first, by age and by size.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace booth::daemon {

struct RetentionRule {
  std::string what;                                                    ///< "session", "recording": for the sentences
  std::string age_key, size_key;                                       ///< of the configuration
  std::int64_t quota_bytes = 0, max_age_days = 0;                      ///< 0: any size, any age
  std::function<bool(const std::filesystem::path& folder)> deletable;  ///< not one that is in work
};

/// Folders of `directory` named YYYYMMDDTHHMMSSZ-... Returns one sentence for each that was deleted, or should have been. By age nothing is deleted while the
/// clock is doubted (clock_belief.hpp). One that is dated more than a day ahead ages from when it was first seen so.
std::vector<std::string> prune_folders(const std::filesystem::path& directory, const RetentionRule& rule, std::int64_t now_utc_ns);

/// Deletes a folder so that what was in it is harder to find again than after a plain deletion: each file is overwritten once, flushed and unlinked; the
/// key of a sealed folder goes before anything else, and everything that was sealed with it becomes noise. On flash and on file systems that write elsewhere
/// the old blocks may live on until they are reused (docs/guide/privacy.md). Returns what is wrong, empty when it is gone.
std::string erase_folder(const std::filesystem::path& folder);

/// The same for recordings, also those that were never finished. `in_work` says of a final name whether it is being written.
std::vector<std::string> prune_recordings(const std::filesystem::path& directory, std::int64_t quota_bytes, std::int64_t max_age_days, std::int64_t now_utc_ns,
                                          const std::function<bool(const std::string& name)>& in_work);

}  // namespace booth::daemon
