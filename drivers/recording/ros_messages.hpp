// The four ROS 2 messages of a depth recording, to CDR bytes and back.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::drivers::ros {

using Bytes = std::vector<char>;

/// sensor_msgs/msg/Image, encoding 16UC1.
void image(const hal::CameraDescription& camera, hal::UtcTime stamp, const std::string& frame_id, const std::vector<std::uint16_t>& depth, Bytes& out);
/// sensor_msgs/msg/CompressedImage, format `16UC1; compressedDepth rvl`; `packed` is what rvl_pack() made.
void compressed_image(const hal::CameraDescription& camera, hal::UtcTime stamp, const std::string& frame_id, std::span<const std::byte> packed, Bytes& out);
/// sensor_msgs/msg/CameraInfo, plumb_bob.
void camera_info(const hal::CameraDescription& camera, hal::UtcTime stamp, const std::string& frame_id, Bytes& out);
/// tf2_msgs/msg/TFMessage: the pose of each camera's optical frame in the frame `booth`.
void tf_static(const std::vector<hal::CameraDescription>& cameras, const std::vector<std::string>& frame_ids, hal::UtcTime stamp, Bytes& out);

/// std_msgs/msg/String.
void string(const std::string& text, Bytes& out);
/// sensor_msgs/msg/JointState: names and positions.
void joint_state(hal::UtcTime stamp, const std::string& frame_id, std::span<const std::string> names, std::span<const double> positions, Bytes& out);
/// std_msgs/msg/Int64MultiArray of one dimension.
void integers(std::span<const std::int64_t> values, Bytes& out);

/// The header's stamp of any stamped message; false when the bytes are too few.
bool read_stamp(std::span<const std::byte> message, hal::UtcTime& stamp);
/// False when it is no 16UC1 image of depth.size() pixels, width x height. Never throws.
bool read_image(std::span<const std::byte> message, int width, int height, std::vector<std::uint16_t>& depth) noexcept;
/// The same for a CompressedImage whose format is `16UC1; compressedDepth rvl`.
bool read_compressed_image(std::span<const std::byte> message, int width, int height, std::vector<std::uint16_t>& depth) noexcept;
/// The frame of a compressed depth image; false when it is none, or one compressed in another way (then `format` says which).
bool read_compressed_header(std::span<const std::byte> message, std::string& frame_id, std::string& format);
/// The positions of a JointState; false when there are not as many.
bool read_joint_state(std::span<const std::byte> message, std::span<double> positions);
/// At most `most` values.
bool read_integers(std::span<const std::byte> message, std::size_t most, std::vector<std::int64_t>& values);
/// The size and frame of an image; false when the bytes are no 16UC1 image.
bool read_image_header(std::span<const std::byte> message, std::string& frame_id);
bool read_camera_info(std::span<const std::byte> message, hal::Intrinsics& intrinsics, std::string& frame_id);

struct Transform {
  std::string parent, child;
  hal::RigidTransform child_to_parent;
};
bool read_tf(std::span<const std::byte> message, std::vector<Transform>& out);

}  // namespace booth::drivers::ros
