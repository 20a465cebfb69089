// What the drift watch finds, in words for status, log and events.
#pragma once

#include <string>

#include "daemon/pipeline/frame_fitter.hpp"

namespace booth::daemon {

/// A person should look after it.
bool off_its_place(CameraDriftStatus::Verdict verdict);
inline bool off_its_place(const CameraDriftStatus& camera) { return off_its_place(camera.verdict); }

/// One sentence: the camera, what is wrong with its place, what to do.
std::string drift_sentence(const std::string& name, const CameraDriftStatus& camera);

}  // namespace booth::daemon
