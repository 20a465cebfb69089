// The parts of each message that never change are written once, the others for each frame.
#include "daemon/dds/ros2/ros2_messages.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace booth::daemon {
namespace {

constexpr std::uint8_t kFloat32 = 7;  ///< PointField.datatype
constexpr std::uint32_t kPointBytes = 3 * sizeof(float);

builtin_interfaces_msg_dds__Time_ ros_time(std::int64_t utc_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  utc_ns = std::max<std::int64_t>(utc_ns, 0);
  return {static_cast<std::int32_t>(std::min<std::int64_t>(utc_ns / kSecond, INT32_MAX)), static_cast<std::uint32_t>(utc_ns % kSecond)};
}

geometry_msgs_msg_dds__Quaternion_ ros_quaternion(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

geometry_msgs_msg_dds__Transform_ ros_transform(const FramePose& pose) {
  return {{pose.translation.x(), pose.translation.y(), pose.translation.z()}, ros_quaternion(pose.rotation)};
}

/// A sequence over memory that is not the sequence's own.
template <class Sequence, class T>
void set_sequence(Sequence& sequence, T* values, std::size_t count) {
  sequence._buffer = values;
  sequence._maximum = sequence._length = static_cast<std::uint32_t>(count);
  sequence._release = false;
}

}  // namespace

void Ros2Cloud::take(const fit::Cloud& cloud) {
  size = std::clamp(cloud.size, 0, kMostPoints);
  for (int i = 0; i < size; ++i) {
    const auto from = static_cast<std::size_t>(static_cast<std::int64_t>(i) * cloud.size / size), to = 3 * static_cast<std::size_t>(i);
    // CMU frame (y up, z forward, x left) to booth frame (x forward, y left, z up).
    xyz[to] = cloud.z[from];
    xyz[to + 1] = cloud.x[from];
    xyz[to + 2] = cloud.y[from];
  }
}

char* Ros2Messages::keep(std::string text) {
  texts_.push_back(std::make_unique<char[]>(text.size() + 1));
  std::memcpy(texts_.back().get(), text.c_str(), text.size() + 1);
  return texts_.back().get();
}

Ros2Messages::Ros2Messages(const RosNames& names, const std::vector<hal::CameraDescription>& cameras) {
  char* const stage = keep(names.stage);
  char* const body = keep(names.frame("body"));
  transforms_[0].header.frame_id = stage;
  transforms_[0].child_frame_id = body;
  for (std::size_t i = 0; i < kBodyFrames; ++i) {
    transforms_[i + 1].header.frame_id = body;
    transforms_[i + 1].child_frame_id = keep(names.frame(body_frames()[i].link));
  }
  set_sequence(tf.transforms, transforms_.data(), transforms_.size());

  std::vector<std::string> camera_names;
  for (const auto& camera : cameras) camera_names.push_back(camera.name);
  camera_names = ros_tokens(camera_names);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    geometry_msgs_msg_dds__TransformStamped_ one{};
    one.header.frame_id = stage;
    one.child_frame_id = keep(names.frame(camera_names[i]) + "_optical");
    one.transform = ros_transform(camera_frame(cameras[i].camera_to_world));
    cameras_.push_back(one);
  }
  set_sequence(tf_static.transforms, cameras_.data(), cameras_.size());

  for (int d = 0; d < fit::kPoseDofs; ++d) angle_names_[static_cast<std::size_t>(d)] = keep(names.frame(fit::dof_name(fit::kRootDofs + d)));
  joint_states.header.frame_id = body;
  set_sequence(joint_states.name, angle_names_.data(), angle_names_.size());
  set_sequence(joint_states.position, angles_.data(), angles_.size());

  joints.header.frame_id = stage;
  set_sequence(joints.poses, poses_.data(), poses_.size());

  for (std::uint32_t i = 0; i < 3; ++i)
    fields_[i] = {.name = keep(std::string(1, "xyz"[i])), .offset = i * static_cast<std::uint32_t>(sizeof(float)), .datatype = kFloat32, .count = 1};
  cloud.header.frame_id = stage;
  cloud.height = 1;
  set_sequence(cloud.fields, fields_.data(), fields_.size());
  cloud.is_bigendian = std::endian::native == std::endian::big;
  cloud.point_step = kPointBytes;
  cloud.is_dense = true;

  ids_[0] = keep(names.id);
  tracked.header.frame_id = stage;
  set_sequence(tracked.ids, ids_.data(), 0);
}

void Ros2Messages::fill(const Ros2Frame& frame) {
  const builtin_interfaces_msg_dds__Time_ stamp = ros_time(frame.captured_utc_ns);
  const FramePose body = body_frame(frame.pose);
  transforms_[0].transform = ros_transform(body);
  for (std::size_t i = 0; i < kBodyFrames; ++i) transforms_[i + 1].transform = ros_transform(link_frame(frame.pose, body, body_frames()[i]));
  for (auto& t : transforms_) t.header.stamp = stamp;
  joint_states.header.stamp = stamp;
  angles_ = frame.angles;
  joints.header.stamp = stamp;
  for (std::size_t j = 0; j < kRecordJoints; ++j) {
    const auto& p = frame.pose.joints[j];
    poses_[j] = {{p[0], p[1], p[2]}, ros_quaternion(bone_rotation(frame.pose, static_cast<int>(j)))};
  }
}

void Ros2Messages::fill(const Ros2Cloud& from) {
  cloud.header.stamp = ros_time(from.captured_utc_ns);
  cloud.width = static_cast<std::uint32_t>(from.size);
  cloud.row_step = cloud.width * kPointBytes;
  // The library reads what it sends through a pointer that could write.
  set_sequence(cloud.data, const_cast<std::uint8_t*>(reinterpret_cast<const std::uint8_t*>(from.xyz.data())), cloud.row_step);
}

void Ros2Messages::fill_tracked(bool present, std::int64_t utc_ns) {
  tracked.header.stamp = ros_time(utc_ns);
  tracked.ids._length = present ? 1 : 0;
}

}  // namespace booth::daemon
