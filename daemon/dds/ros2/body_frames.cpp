// The table of frames, and the way from joints and rotations to them.
#include "daemon/dds/ros2/body_frames.hpp"

#include <algorithm>
#include <cmath>

#include "fit/body/skeleton.hpp"

namespace booth::daemon {
namespace {

BodyFrame made(const char* link, const char* joint, const char* bone) { return {link, fit::joint_index(joint), fit::bone_index(bone)}; }

Eigen::Vector3d joint(const BodyPose& pose, int j) { return Eigen::Map<const Eigen::Vector3d>(pose.joints[static_cast<std::size_t>(j)].data()); }

}  // namespace

Eigen::Quaterniond bone_rotation(const BodyPose& pose, int bone) {
  const auto& r = pose.rotation[static_cast<std::size_t>(bone)];
  const Eigen::Quaterniond out(r[3], r[0], r[1], r[2]);
  return out.squaredNorm() > 1e-12 ? out.normalized() : Eigen::Quaterniond::Identity();
}

const std::array<BodyFrame, kBodyFrames>& body_frames() {
  // A link begins at the joint that moves it, as in REP-155: l_elbow is the forearm's frame. Those without a name there: neck, clavicle, foot, and the ends.
  static const std::array<BodyFrame, kBodyFrames> kFrames{{made("waist", "spine_pivot", "upperback"),
                                                           made("torso", "chest_top", "upperback"),
                                                           made("neck", "neck_pivot", "neck"),
                                                           made("head", "head_base", "head"),
                                                           made("head_top", "head_top", "head"),
                                                           made("l_clavicle", "chest_top", "lclavicle"),
                                                           made("l_shoulder", "lshoulder", "lhumerus"),
                                                           made("l_elbow", "lelbow", "lradius"),
                                                           made("l_wrist", "lwrist", "lhand"),
                                                           made("l_hand", "lhand_end", "lhand"),
                                                           made("r_clavicle", "chest_top", "rclavicle"),
                                                           made("r_shoulder", "rshoulder", "rhumerus"),
                                                           made("r_elbow", "relbow", "rradius"),
                                                           made("r_wrist", "rwrist", "rhand"),
                                                           made("r_hand", "rhand_end", "rhand"),
                                                           made("l_hip", "lhip", "lfemur"),
                                                           made("l_knee", "lknee", "ltibia"),
                                                           made("l_ankle", "lankle", "lfoot"),
                                                           made("l_foot", "lfoot_end", "ltoes"),
                                                           made("l_toe", "ltoe_end", "ltoes"),
                                                           made("r_hip", "rhip", "rfemur"),
                                                           made("r_knee", "rknee", "rtibia"),
                                                           made("r_ankle", "rankle", "rfoot"),
                                                           made("r_foot", "rfoot_end", "rtoes"),
                                                           made("r_toe", "rtoe_end", "rtoes")}};
  return kFrames;
}

FramePose body_frame(const BodyPose& pose) {
  static const int kLeft = fit::joint_index("lhip"), kRight = fit::joint_index("rhip");
  return {0.5 * (joint(pose, kLeft) + joint(pose, kRight)), bone_rotation(pose, 0)};
}

FramePose link_frame(const BodyPose& pose, const FramePose& body, const BodyFrame& frame) {
  const Eigen::Quaterniond back = body.rotation.conjugate();
  return {back * (joint(pose, frame.joint) - body.translation), (back * bone_rotation(pose, frame.bone)).normalized()};
}

FramePose camera_frame(const hal::RigidTransform& camera_to_world) {
  const Eigen::Matrix3d r = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera_to_world.rotation.data());
  return {Eigen::Map<const Eigen::Vector3d>(camera_to_world.translation.data()), Eigen::Quaterniond(r).normalized()};
}

bool is_finite(const BodyPose& pose) {
  const auto good = [](const auto& list) { return std::all_of(list.begin(), list.end(), [](auto v) { return std::isfinite(v); }); };
  return std::all_of(pose.joints.begin(), pose.joints.end(), good) && std::all_of(pose.rotation.begin(), pose.rotation.end(), good);
}

}  // namespace booth::daemon
