// A path first, then an id.
#include "daemon/ctl/find_session.hpp"

#include <fmt/format.h>

#include "daemon/config/load.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {

namespace fs = std::filesystem;

fs::path find_session(const std::string& session, const std::string& directory, const std::string& config) {
  std::error_code ignored;
  if (fs::is_directory(session, ignored)) return fs::path(session + "/").parent_path();
  fs::path place = directory;
  if (place.empty()) place = load_config({.file = config, .assignments = {}}).session.directory;
  if (session.find('/') == std::string::npos && fs::is_directory(place / session, ignored)) return place / session;
  throw VerbFailure(fmt::format("{}: there is no such session, neither as a folder nor in {} (--sessions names another place)", session, place.string()));
}

}  // namespace booth::daemon
