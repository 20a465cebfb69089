// What a booth says of itself on DDS, made from what it knows of itself.
#pragma once

#include <string>

#include "daemon/dds/dds_link.hpp"
#include "daemon/session/controller.hpp"
#include "fit/body/body_model.hpp"

namespace booth::daemon {

/// `now_utc_ns` dates the calibration; the folder of the sessions (or the nearest one above it that exists) is asked for its disk.
StatusSample status_sample(const DaemonStatus& status, const ControllerSettings& settings, std::int64_t now_utc_ns);

/// Shape, bones and measurements of the body in `frame`. Allocates; a few milliseconds.
BodySample body_sample(const FrameRecord& frame, const fit::BodyModel& model, const std::string& session);

}  // namespace booth::daemon
