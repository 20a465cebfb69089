// Worked out here from the frame alone, by other ways than the mirror's.
#include "tests/daemon/dds/ros2/expectations.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <map>

#include "fit/body/skeleton.hpp"

namespace booth::tests {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Booth axes of a rotation of the CMU frame.
Matrix3d booth_rotation(const Matrix3d& cmu) {
  Matrix3d turn;
  turn << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return turn * cmu * turn.transpose();
}

void expect_header(const Json& header, const std::string& frame, std::int64_t utc_ns) {
  EXPECT_EQ(header.at("frame_id"), frame);
  EXPECT_EQ(header.at("sec").get<std::int64_t>() * 1'000'000'000 + header.at("nanosec").get<std::int64_t>(), utc_ns);
  EXPECT_LT(header.at("nanosec").get<std::int64_t>(), 1'000'000'000);
}

Vector3d vector(const Json& j) { return Vector3d(j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()); }
Isometry3d pose(const Json& translation, const Json& rotation) {
  const Quaterniond q(rotation.at(3).get<double>(), rotation.at(0).get<double>(), rotation.at(1).get<double>(), rotation.at(2).get<double>());
  EXPECT_NEAR(q.norm(), 1, 1e-9);
  return Eigen::Translation3d(vector(translation)) * q;
}

Vector3d joint(const daemon::FrameRecord& frame, const char* name) { return Vector3d(frame.joints[static_cast<std::size_t>(fit::joint_index(name))].data()); }
Matrix3d bone(const daemon::FrameRecord& frame, const char* name) {
  const auto& r = frame.rotation[static_cast<std::size_t>(fit::bone_index(name))];
  return Quaterniond(r[3], r[0], r[1], r[2]).normalized().toRotationMatrix();
}

struct Link {
  const char *joint, *bone;
};
/// REP-155's links, and what the booth adds to them.
const std::map<std::string, Link>& links() {
  static const std::map<std::string, Link> all{{"waist", {"spine_pivot", "upperback"}},
                                               {"torso", {"chest_top", "upperback"}},
                                               {"neck", {"neck_pivot", "neck"}},
                                               {"head", {"head_base", "head"}},
                                               {"head_top", {"head_top", "head"}},
                                               {"l_clavicle", {"chest_top", "lclavicle"}},
                                               {"l_shoulder", {"lshoulder", "lhumerus"}},
                                               {"l_elbow", {"lelbow", "lradius"}},
                                               {"l_wrist", {"lwrist", "lhand"}},
                                               {"l_hand", {"lhand_end", "lhand"}},
                                               {"l_hip", {"lhip", "lfemur"}},
                                               {"l_knee", {"lknee", "ltibia"}},
                                               {"l_ankle", {"lankle", "lfoot"}},
                                               {"l_foot", {"lfoot_end", "ltoes"}},
                                               {"l_toe", {"ltoe_end", "ltoes"}},
                                               {"r_clavicle", {"chest_top", "rclavicle"}},
                                               {"r_shoulder", {"rshoulder", "rhumerus"}},
                                               {"r_elbow", {"relbow", "rradius"}},
                                               {"r_wrist", {"rwrist", "rhand"}},
                                               {"r_hand", {"rhand_end", "rhand"}},
                                               {"r_hip", {"rhip", "rfemur"}},
                                               {"r_knee", {"rknee", "rtibia"}},
                                               {"r_ankle", {"rankle", "rfoot"}},
                                               {"r_foot", {"rfoot_end", "rtoes"}},
                                               {"r_toe", {"rtoe_end", "rtoes"}}};
  return all;
}

/// Camera at `from` whose optical axis meets the booth's middle at 1 m height.
hal::CameraDescription camera(const std::string& name, const Vector3d& from) {
  hal::CameraDescription out;
  out.name = name;
  const Vector3d z = (Vector3d(0, 0, 1) - from).normalized(), x = z.cross(Vector3d::UnitZ()).normalized(), y = z.cross(x);
  for (std::size_t r = 0; r < 3; ++r) {
    const auto row = static_cast<Eigen::Index>(r);
    out.camera_to_world.rotation[3 * r] = x[row];
    out.camera_to_world.rotation[3 * r + 1] = y[row];
    out.camera_to_world.rotation[3 * r + 2] = z[row];
    out.camera_to_world.translation[r] = from[row];
  }
  return out;
}

}  // namespace

daemon::FrameRecord frame_of(const Json& header) {
  const std::int64_t utc_ns = header.at("sec").get<std::int64_t>() * 1'000'000'000 + header.at("nanosec").get<std::int64_t>();
  const daemon::FrameRecord first = posed_frame(1), second = posed_frame(2);
  const std::int64_t period = second.captured_utc_ns - first.captured_utc_ns, since = utc_ns - first.captured_utc_ns;
  EXPECT_TRUE(since >= 0 && since % period == 0) << utc_ns << " is the stamp of no frame";
  return posed_frame(static_cast<std::uint64_t>(since / period) + 1);
}

daemon::FrameRecord posed_frame(std::uint64_t n) {
  daemon::FrameRecord out;
  out.sequence = n;
  out.person = daemon::PersonState::tracked;
  out.captured_ns = static_cast<std::int64_t>(n) * 33'333'333;
  out.captured_utc_ns = 1'790'000'000'123'456'789 + out.captured_ns;
  fit::PoseVector q;
  for (int d = 0; d < fit::kDofs; ++d) q[d] = 0.03 * (d % 7) - 0.05 + 0.001 * d + 1e-5 * static_cast<double>(n % 1000);
  q[1] = 0.95;
  q[4] = 0.7;
  std::copy(q.data(), q.data() + fit::kDofs, out.q.begin());
  fit::Kinematics k;
  fit::forward_kinematics(q, fit::average_bone_vectors(), k);
  for (int b = 0; b < fit::kBones; ++b) {
    const auto i = static_cast<std::size_t>(b);
    const Vector3d p = fit::booth_from_cmu(k.joint.col(b));
    const Quaterniond r(booth_rotation(k.rotation[i]));
    out.joints[i] = {p.x(), p.y(), p.z()};
    out.rotation[i] = {static_cast<float>(r.x()), static_cast<float>(r.y()), static_cast<float>(r.z()), static_cast<float>(r.w())};
  }
  return out;
}

fit::Cloud numbered_cloud(int points) {
  fit::Cloud out(points);
  for (int i = 0; i < points; ++i) {
    const Vector3d cmu = fit::cmu_from_booth(1e-3 * Vector3d(i, -0.5 * i, 1 + 0.25 * i));
    out.push(cmu.cast<float>(), Eigen::Vector3f::Zero(), 0);
  }
  return out;
}

std::vector<hal::CameraDescription> two_cameras() { return {camera("front-left", {2, 1, 2}), camera("2nd camera", {-2.5, 0.2, 1.5})}; }

void expect_tracked(const Json& message, const std::string& id, bool present, std::int64_t utc_ns) {
  expect_header(message.at("header"), "stage_" + id, utc_ns);
  EXPECT_EQ(message.at("ids"), present ? Json::array({id}) : Json::array());
}

void expect_joint_states(const Json& message, const std::string& id, const daemon::FrameRecord& frame) {
  expect_header(message.at("header"), "body_" + id, frame.captured_utc_ns);
  ASSERT_EQ(message.at("name").size(), 30u);
  ASSERT_EQ(message.at("position").size(), 30u);
  for (int d = 6; d < fit::kDofs; ++d) {
    const auto i = static_cast<std::size_t>(d - 6);
    EXPECT_EQ(message.at("name")[i], std::string(fit::dof_name(d)) + "_" + id);
    EXPECT_EQ(message.at("position")[i].get<double>(), frame.q[static_cast<std::size_t>(d)]);
  }
  EXPECT_TRUE(message.at("velocity").empty());
  EXPECT_TRUE(message.at("effort").empty());
}

void expect_tf(const Json& message, const std::string& id, const daemon::FrameRecord& frame) {
  std::map<std::string, Isometry3d> in_stage;
  ASSERT_EQ(message.at("transforms").size(), links().size() + 1);
  const Json& root = message.at("transforms")[0];
  ASSERT_EQ(root.at("child_frame_id"), "body_" + id);
  expect_header(root.at("header"), "stage_" + id, frame.captured_utc_ns);
  const Isometry3d body = pose(root.at("translation"), root.at("rotation"));
  // REP-155: midway between the hips, x out of the body, z towards the head, so that y is the person's left.
  EXPECT_NEAR((body.translation() - 0.5 * (joint(frame, "lhip") + joint(frame, "rhip"))).norm(), 0, 1e-12);
  EXPECT_GT(body.linear().col(1).dot(joint(frame, "lhip") - joint(frame, "rhip")), 0.1);
  EXPECT_GT(body.linear().col(2).dot(joint(frame, "chest_top") - body.translation()), 0.2);
  EXPECT_NEAR((body.linear() - bone(frame, "root")).norm(), 0, 1e-9);
  for (std::size_t i = 1; i < message.at("transforms").size(); ++i) {
    const Json& t = message.at("transforms")[i];
    expect_header(t.at("header"), "body_" + id, frame.captured_utc_ns);  // REP-155: parented to the body's frame
    in_stage[t.at("child_frame_id")] = body * pose(t.at("translation"), t.at("rotation"));
  }
  for (const auto& [name, link] : links()) {
    const auto found = in_stage.find(name + "_" + id);
    ASSERT_NE(found, in_stage.end()) << name;
    EXPECT_NEAR((found->second.translation() - joint(frame, link.joint)).norm(), 0, 1e-12) << name;
    EXPECT_NEAR((found->second.linear() - bone(frame, link.bone)).norm(), 0, 1e-9) << name;
  }
}

void expect_tf_static(const Json& message, const std::string& id) {
  const auto cameras = two_cameras();
  ASSERT_EQ(message.at("transforms").size(), cameras.size());
  const std::vector<std::string> names{"front_left_" + id + "_optical", "b2nd_camera_" + id + "_optical"};
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Json& t = message.at("transforms")[i];
    EXPECT_EQ(t.at("child_frame_id"), names[i]);
    expect_header(t.at("header"), "stage_" + id, 0);
    const Isometry3d placed = pose(t.at("translation"), t.at("rotation"));
    // REP-103: z of an optical frame looks, y points down. The point one metre above the middle lies on the axis.
    EXPECT_NEAR((placed.translation() - Vector3d(cameras[i].camera_to_world.translation.data())).norm(), 0, 1e-12);
    const Vector3d seen = placed.inverse() * Vector3d(0, 0, 1);
    EXPECT_NEAR(seen.x(), 0, 1e-9);
    EXPECT_NEAR(seen.y(), 0, 1e-9);
    EXPECT_NEAR(seen.z(), placed.translation().norm() > 0 ? (Vector3d(0, 0, 1) - placed.translation()).norm() : 0, 1e-9);
    EXPECT_LT(placed.linear().col(1).z(), -0.5);
  }
}

void expect_joints(const Json& message, const std::string& id, const daemon::FrameRecord& frame) {
  expect_header(message.at("header"), "stage_" + id, frame.captured_utc_ns);
  ASSERT_EQ(message.at("poses").size(), 24u);
  for (std::size_t j = 0; j < 24; ++j) {
    const Json& p = message.at("poses")[j];
    for (std::size_t a = 0; a < 3; ++a) EXPECT_EQ(p.at("position")[a].get<double>(), frame.joints[j][a]) << j;
    for (std::size_t a = 0; a < 4; ++a) EXPECT_NEAR(p.at("orientation")[a].get<double>(), static_cast<double>(frame.rotation[j][a]), 1e-6) << j;
  }
}

void expect_cloud(const Json& message, const std::string& id, const daemon::FrameRecord& frame, int points, int told) {
  expect_header(message.at("header"), "stage_" + id, frame.captured_utc_ns);
  EXPECT_EQ(message.at("height"), 1);
  EXPECT_EQ(message.at("width"), told);
  EXPECT_EQ(message.at("point_step"), 12);
  EXPECT_EQ(message.at("row_step"), 12 * told);
  EXPECT_EQ(message.at("is_bigendian"), false);
  EXPECT_EQ(message.at("is_dense"), true);
  ASSERT_EQ(message.at("fields").size(), 3u);
  for (std::size_t f = 0; f < 3; ++f) {
    const Json& field = message.at("fields")[f];
    EXPECT_EQ(field.at("name"), std::string(1, "xyz"[f]));
    EXPECT_EQ(field.at("offset"), 4 * f);
    EXPECT_EQ(field.at("datatype"), 7);  // FLOAT32
    EXPECT_EQ(field.at("count"), 1);
  }
  const auto bytes = message.at("data").get<std::vector<std::uint8_t>>();
  ASSERT_EQ(bytes.size(), static_cast<std::size_t>(12 * told));
  int last = -1;
  for (int i = 0; i < told; ++i) {
    float p[3];
    std::memcpy(p, bytes.data() + 12 * i, sizeof p);
    const int n = static_cast<int>(std::lround(1000 * p[0]));  // which point it is
    ASSERT_GT(n, last);
    ASSERT_LT(n, points);
    last = n;
    ASSERT_NEAR(p[1], -0.0005 * n, 1e-5);
    ASSERT_NEAR(p[2], 0.001 + 0.00025 * n, 1e-5);
  }
  EXPECT_GE(last, points - 1 - points / std::max(told, 1)) << "the whole cloud is thinned, not cut";
}

}  // namespace booth::tests
