// A person with every number different from every other, and what each ROS 2 message must say of that person; as JSON, so that readers of any vendor can be
// asked.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "fit/cloud/observation.hpp"
#include "hal/depth_frame.hpp"

namespace booth::tests {

using Json = nlohmann::json;

/// Somebody in a pose that is nobody's rest, standing beside the middle and turned; joints and rotations agree with q.
daemon::FrameRecord posed_frame(std::uint64_t n = 7);
/// The posed_frame() of which a message with this header is; fails the running test when it is of none.
daemon::FrameRecord frame_of(const Json& header);
/// Point i is at x = i, y = -i / 2, z = 1 + i / 4 millimetres of the booth frame.
fit::Cloud numbered_cloud(int points);
/// Two cameras that look at the middle from the front left and from behind; the second one's name is no name in ROS.
std::vector<hal::CameraDescription> two_cameras();

// Each fails the running test for every field that is not as it must be. `id` is the token of the booth.
void expect_tracked(const Json& message, const std::string& id, bool present, std::int64_t utc_ns);
void expect_joint_states(const Json& message, const std::string& id, const daemon::FrameRecord& frame);
void expect_tf(const Json& message, const std::string& id, const daemon::FrameRecord& frame);
void expect_tf_static(const Json& message, const std::string& id);
void expect_joints(const Json& message, const std::string& id, const daemon::FrameRecord& frame);
/// The cloud of numbered_cloud(points), of which `told` were told.
void expect_cloud(const Json& message, const std::string& id, const daemon::FrameRecord& frame, int points, int told);

}  // namespace booth::tests
