// A session's folder read back, whatever became of it: complete, interrupted, or still running.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"

namespace booth::daemon {

class Seal;

struct SessionContents {
  std::string id, result;  ///< result: running, complete, interrupted
  std::vector<FrameRecord> frames;
  std::string warning;  ///< a sentence where the session is of the next version's format, from which what is not known is passed over
};

/// Sessions of this version and of its neighbours (hal/file_version.hpp). A sealed session is read with its seal; without it, that it is sealed and what to do
/// is the error. From the raw log where it is still there, else from skeleton.csv (whose numbers are floats) and session.json. Throws std::runtime_error with
/// one sentence that names the file, the place and what is wrong.
SessionContents read_session(const std::filesystem::path& folder, const Seal* seal = nullptr);

/// The rows of a skeleton.csv: times, states, poses, joints and residuals; no body. Columns after those are a later version's and passed over. `name` is for
/// the errors, which are std::runtime_error.
std::vector<FrameRecord> parse_skeleton_csv(std::string_view text, const std::string& name);

}  // namespace booth::daemon
