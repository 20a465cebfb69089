// Which topics a recording has and what their messages hold (docs/reference/recordings.md).
#include "drivers/recording/rosbag2_writer.hpp"

#include <set>
#include <stdexcept>

#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/layouts.hpp"
#include "drivers/recording/rvl.hpp"

namespace booth::drivers {

std::string ros_name(const std::string& name) {
  std::string out;
  for (const char c : name) out += (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ? c : '_';
  return out.empty() || (out[0] >= '0' && out[0] <= '9') ? "camera_" + out : out;
}

void check_ros_cameras(const std::vector<hal::CameraDescription>& cameras, bool depth) {
  std::set<std::string> names;
  for (const auto& c : cameras) {
    if (depth && c.depth_scale != 0.001)
      throw std::runtime_error("camera '" + c.name + "' counts " + std::to_string(c.depth_scale) +
                               " m, ROS depth images are in millimetres: use the folder layout");
    if (!names.insert(ros_name(c.name)).second) throw std::runtime_error("two cameras have the same name in ROS ('" + ros_name(c.name) + "'): rename one");
  }
}

Rosbag2Writer::Rosbag2Writer(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras, const std::optional<TruthBody>& body,
                             const std::vector<hal::DepthFrame>& background, BagContents contents)
    : cameras_(cameras), beta_(body ? body->beta : std::vector<double>{}), background_(background), contents_(contents), bag_(path), last_(cameras.size()) {
  check_ros_cameras(cameras_, contents_.depth);
  std::size_t pixels = 0;
  for (const auto& c : cameras_) {
    pixels = std::max(pixels, static_cast<std::size_t>(c.intrinsics.width) * static_cast<std::size_t>(c.intrinsics.height));
    const std::string base = "/" + ros_name(c.name) + "/depth";
    frame_id_.push_back(ros_name(c.name) + "_depth_optical_frame");
    if (!contents_.depth) continue;
    image_topic_.push_back(contents_.compressed ? bag_.add_topic(base + "/image_raw/compressedDepth", "sensor_msgs/msg/CompressedImage", false)
                                                : bag_.add_topic(base + "/image_raw", "sensor_msgs/msg/Image", false));
    info_topic_.push_back(bag_.add_topic(base + "/camera_info", "sensor_msgs/msg/CameraInfo", false));
    background_topic_.push_back(bag_.add_topic(base + "/background", "sensor_msgs/msg/Image", true));
  }
  packed_.resize(rvl_bound(pixels));
  unpacked_.resize(pixels);
  tf_topic_ = bag_.add_topic("/tf_static", "tf2_msgs/msg/TFMessage", true);
  if (contents_.groups) {
    event_topic_ = bag_.add_topic("/booth/event", "std_msgs/msg/String", false);
    joint_topic_ = bag_.add_topic("/booth/joint_states", "sensor_msgs/msg/JointState", false);
    group_topic_ = bag_.add_topic("/booth/group", "std_msgs/msg/Int64MultiArray", false);
    for (std::size_t i = 0; i < hal::kRecordedDofs; ++i) dof_names_.push_back("q" + std::to_string(i));
  }
  // Bits that quaternions round, and what ROS has no field for.
  write_calibration(bag_.folder() / "calibration.toml", cameras_);
  if (body) write_truth_ply(bag_.folder() / "truth.ply", *body);
}

/// What a player needs before the first frame: where the cameras are and what the empty room looks like.
void Rosbag2Writer::begin(hal::UtcTime utc) {
  if (begun_) return;
  begun_ = true;
  ros::tf_static(cameras_, frame_id_, utc, bytes_);
  bag_.insert(tf_topic_, utc, bytes_);
  if (!contents_.depth) return;
  for (const auto& frame : background_) {
    const auto& camera = camera_of(frame, cameras_);
    const auto i = static_cast<std::size_t>(hal::to_int(frame.camera));
    ros::image(camera, utc, frame_id_[i], frame.depth, bytes_);
    bag_.insert(background_topic_[i], utc, bytes_);
  }
}

/// A wall clock that was set back must not change the order of frames.
hal::UtcTime Rosbag2Writer::stamp(std::size_t camera, hal::UtcTime utc) {
  begin(utc);
  return last_[camera] = std::max(utc, last_[camera] + hal::Nanoseconds(1));
}

void Rosbag2Writer::write_info(std::size_t i) {
  bag_.insert(image_topic_[i], last_[i], bytes_);
  ros::camera_info(cameras_[i], last_[i], frame_id_[i], bytes_);
  bag_.insert(info_topic_[i], last_[i], bytes_);
  bag_.commit_if_due();
}

void Rosbag2Writer::write(const hal::DepthFrame& frame, hal::UtcTime utc) {
  const auto& camera = camera_of(frame, cameras_);
  const auto i = static_cast<std::size_t>(hal::to_int(frame.camera));
  if (contents_.compressed) {
    write_packed(i, {packed_.data(), rvl_pack(frame.depth, packed_.data())}, utc);
    return;
  }
  const hal::UtcTime at = stamp(i, utc);
  ros::image(camera, at, frame_id_[i], frame.depth, bytes_);
  write_info(i);
}

void Rosbag2Writer::write_packed(std::size_t i, std::span<const std::byte> packed, hal::UtcTime utc) {
  const hal::UtcTime at = stamp(i, utc);
  if (contents_.compressed) {
    ros::compressed_image(cameras_[i], at, frame_id_[i], packed, bytes_);
  } else {
    const auto& k = cameras_[i].intrinsics;
    unpacked_.resize(static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height));
    if (!rvl_unpack(packed, unpacked_)) throw std::runtime_error("a packed depth image of camera '" + cameras_[i].name + "' is damaged");
    ros::image(cameras_[i], at, frame_id_[i], unpacked_, bytes_);
  }
  write_info(i);
}

void Rosbag2Writer::write_group(const hal::FittedGroup& group, hal::Nanoseconds utc_offset) {
  const hal::UtcTime utc(group.reference.time_since_epoch() + utc_offset);
  begin(utc);
  std::vector<std::int64_t> values{static_cast<std::int64_t>(group.sequence), group.reference.time_since_epoch().count(), utc_offset.count(), group.person};
  for (std::size_t i = 0; i < cameras_.size() && i < group.captured.size(); ++i) values.push_back(group.captured[i].time_since_epoch().count());
  ros::integers(values, bytes_);
  bag_.insert(group_topic_, utc, bytes_);
  ros::joint_state(utc, "booth", dof_names_, group.q, bytes_);
  bag_.insert(joint_topic_, utc, bytes_);
  bag_.commit_if_due();
}

void Rosbag2Writer::write_event(const std::string& text, hal::UtcTime utc) {
  begin(utc);
  ros::string(text, bytes_);
  bag_.insert(event_topic_, utc, bytes_);
  bag_.commit_if_due();
}

void Rosbag2Writer::write_truth(hal::UtcTime utc, const hal::TruthSample& truth) {
  if (!truth_) truth_.emplace(bag_.folder() / "truth.csv", beta_);
  truth_->write(utc, truth);
}

void Rosbag2Writer::close() {
  if (truth_) truth_->close();
  bag_.close();
}

std::unique_ptr<hal::DepthSink> write_rosbag2(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                              const std::optional<TruthBody>& body, const std::vector<hal::DepthFrame>& background, bool compressed) {
  return std::make_unique<Rosbag2Writer>(path, cameras, body, background, BagContents{.compressed = compressed});
}

}  // namespace booth::drivers
