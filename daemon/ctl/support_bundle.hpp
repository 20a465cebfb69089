// What of a booth may leave it in a support bundle, and the archive that carries it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/ctl/status_reading.hpp"

namespace booth::daemon {

struct BundleFile {
  std::string name;  ///< below "boothd-report/", at most 80 bytes
  std::string what;  ///< one sentence for the list of contents
  std::string bytes;
};

/// Names of sessions and recordings, which are the moments at which people stood in the booth, become "(name left out)"; bytes that are not text become '?'.
std::string without_session_names(const std::string& text);

/// Each of the values becomes "(left out)", wherever it stands as a word or a path of its own: what the configuration names comes again in sentences.
std::string without_values(const std::string& text, const std::vector<std::string>& values);

/// IPv4 addresses become "(address left out)": the DDS library names the machines with which it speaks.
std::string without_addresses(const std::string& text);

/// Of a status only what is listed here: nothing of the person in the booth, of the session, of the last one, and no paths of recordings.
std::string status_for_report(const StatusJson& status);

/// A POSIX ustar archive, which tar reads; CONTENTS.txt comes first and lists the others. `utc_seconds` is the time that all files get. Throws
/// std::invalid_argument for a name that is too long.
std::string bundle_archive(const std::vector<BundleFile>& files, std::int64_t utc_seconds);

}  // namespace booth::daemon
