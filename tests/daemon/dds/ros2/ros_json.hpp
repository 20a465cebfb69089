// ROS 2 messages as our own reader has them, as JSON of the same shape as that of fastdds_reader.cpp.
#pragma once

#include <nlohmann/json.hpp>

#include "ros2_messages.h"

namespace booth::tests {

inline nlohmann::json ros_json(const std_msgs_msg_dds__Header_& h) { return {{"sec", h.stamp.sec}, {"nanosec", h.stamp.nanosec}, {"frame_id", h.frame_id}}; }
inline nlohmann::json ros_json(const geometry_msgs_msg_dds__Quaternion_& q) { return {q.x, q.y, q.z, q.w}; }
template <class Xyz>
nlohmann::json ros_xyz(const Xyz& v) {
  return {v.x, v.y, v.z};
}
template <class Sequence>
nlohmann::json ros_list(const Sequence& s) {
  nlohmann::json out = nlohmann::json::array();
  for (std::uint32_t i = 0; i < s._length; ++i) out.push_back(s._buffer[i]);
  return out;
}

inline nlohmann::json ros_json(const hri_msgs_msg_dds__IdsList_& m) { return {{"header", ros_json(m.header)}, {"ids", ros_list(m.ids)}}; }
inline nlohmann::json ros_json(const sensor_msgs_msg_dds__JointState_& m) {
  return {{"header", ros_json(m.header)},
          {"name", ros_list(m.name)},
          {"position", ros_list(m.position)},
          {"velocity", ros_list(m.velocity)},
          {"effort", ros_list(m.effort)}};
}
inline nlohmann::json ros_json(const tf2_msgs_msg_dds__TFMessage_& m) {
  nlohmann::json out = nlohmann::json::array();
  for (std::uint32_t i = 0; i < m.transforms._length; ++i) {
    const auto& t = m.transforms._buffer[i];
    out.push_back({{"header", ros_json(t.header)},
                   {"child_frame_id", t.child_frame_id},
                   {"translation", ros_xyz(t.transform.translation)},
                   {"rotation", ros_json(t.transform.rotation)}});
  }
  return {{"transforms", out}};
}
inline nlohmann::json ros_json(const geometry_msgs_msg_dds__PoseArray_& m) {
  nlohmann::json poses = nlohmann::json::array();
  for (std::uint32_t i = 0; i < m.poses._length; ++i)
    poses.push_back({{"position", ros_xyz(m.poses._buffer[i].position)}, {"orientation", ros_json(m.poses._buffer[i].orientation)}});
  return {{"header", ros_json(m.header)}, {"poses", poses}};
}
inline nlohmann::json ros_json(const sensor_msgs_msg_dds__PointCloud2_& m) {
  nlohmann::json fields = nlohmann::json::array();
  for (std::uint32_t i = 0; i < m.fields._length; ++i) {
    const auto& f = m.fields._buffer[i];
    fields.push_back({{"name", f.name}, {"offset", f.offset}, {"datatype", f.datatype}, {"count", f.count}});
  }
  return {{"header", ros_json(m.header)}, {"height", m.height},     {"width", m.width},         {"fields", fields},      {"is_bigendian", m.is_bigendian},
          {"point_step", m.point_step},   {"row_step", m.row_step}, {"data", ros_list(m.data)}, {"is_dense", m.is_dense}};
}

}  // namespace booth::tests
