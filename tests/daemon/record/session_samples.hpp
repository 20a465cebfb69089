// A session's frames for tests: a capsule man who walks along x of the booth.
#pragma once

#include <vector>

#include "daemon/record/session_files.hpp"

namespace booth::tests {

const daemon::SessionModels& sample_models();
std::vector<daemon::FrameRecord> sample_frames(std::uint64_t count);
daemon::SessionInfo sample_info();

}  // namespace booth::tests
