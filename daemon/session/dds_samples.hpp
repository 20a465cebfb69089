// What a booth says of itself on DDS, made from what it knows of itself.
#pragma once

#include <string>

#include "daemon/dds/dds_link.hpp"
#include "daemon/session/controller.hpp"
#include "fit/body/body_model.hpp"

namespace booth::daemon {

StatusSample status_sample(const DaemonStatus& status);

/// Shape, bones and measurements of the body in `frame`. Allocates; a few milliseconds.
BodySample body_sample(const FrameRecord& frame, const fit::BodyModel& model, const std::string& session);

}  // namespace booth::daemon
