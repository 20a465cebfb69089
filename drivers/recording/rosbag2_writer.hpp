// Depth images of several cameras, what belongs to them, and what boothd made of them, as ROS 2 messages in a bag.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "drivers/recording/bag_file.hpp"
#include "drivers/recording/ros_messages.hpp"
#include "drivers/recording/truth_file.hpp"
#include "hal/depth_sink.hpp"
#include "hal/flight_recorder.hpp"

namespace booth::drivers {

struct BagContents {
  bool compressed = false;  ///< CompressedImage with RVL instead of Image
  bool depth = true;        ///< false: no image topics
  bool groups = false;      ///< topics for events and fitted frames
};

class Rosbag2Writer final : public hal::DepthSink {
 public:
  /// Throws std::runtime_error: the path exists, the disk is full, depth in other units than ROS has.
  Rosbag2Writer(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras, const std::optional<TruthBody>& body,
                const std::vector<hal::DepthFrame>& background, BagContents contents);

  void write(const hal::DepthFrame& frame, hal::UtcTime utc) override;
  void write_truth(hal::UtcTime utc, const hal::TruthSample& truth) override;
  void close() override;

  /// A frame that rvl_pack() has packed already.
  void write_packed(std::size_t camera, std::span<const std::byte> packed, hal::UtcTime utc);
  /// `utc_offset`: what was added to monotonic time to get the stamps of this bag.
  void write_group(const hal::FittedGroup& group, hal::Nanoseconds utc_offset);
  /// `text` is one JSON object.
  void write_event(const std::string& text, hal::UtcTime utc);
  BagFile& bag() { return bag_; }

 private:
  void begin(hal::UtcTime utc);
  void write_info(std::size_t camera);
  hal::UtcTime stamp(std::size_t camera, hal::UtcTime utc);

  const std::vector<hal::CameraDescription> cameras_;
  const std::vector<double> beta_;
  const std::vector<hal::DepthFrame> background_;
  const BagContents contents_;
  BagFile bag_;
  std::vector<std::size_t> image_topic_, info_topic_, background_topic_;
  std::size_t tf_topic_ = 0, event_topic_ = 0, group_topic_ = 0, joint_topic_ = 0;
  std::vector<std::string> frame_id_, dof_names_;
  std::vector<hal::UtcTime> last_;
  std::vector<std::byte> packed_;
  std::vector<std::uint16_t> unpacked_;
  bool begun_ = false;
  ros::Bytes bytes_;
  std::optional<TruthWriter> truth_;
};

/// Throws std::runtime_error where a bag cannot hold what these cameras see: depth in other units than ROS has, two names that ROS cannot tell apart.
void check_ros_cameras(const std::vector<hal::CameraDescription>& cameras, bool depth);

/// A ROS name: letters, digits and underscores, no digit first.
std::string ros_name(const std::string& name);

}  // namespace booth::drivers
