// How verbs find the session that a person names.
#pragma once

#include <filesystem>
#include <string>

namespace booth::daemon {

/// A folder as it is named, else the session of that id in `directory`, or where that is empty in the configuration's (`config`; empty: the installed one's).
/// Throws VerbFailure.
std::filesystem::path find_session(const std::string& session, const std::string& directory, const std::string& config);

}  // namespace booth::daemon
