// The messages inside a bag, of any bytes, and good ones with bytes changed: finite facts within their sizes, or no.
#include <cmath>
#include <string>
#include <vector>

#include "drivers/recording/ros_messages.hpp"
#include "drivers/recording/rvl.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth;
using namespace booth::drivers;
using fuzz::require;

constexpr int kSide = 8;

const std::vector<ros::Bytes>& good() {
  static const std::vector<ros::Bytes> messages = [] {
    hal::CameraDescription camera;
    camera.name = "a";
    camera.intrinsics = {.width = kSide, .height = kSide, .fx = 8, .fy = 8, .cx = 4, .cy = 4, .distortion = {}};
    const std::vector<std::uint16_t> depth(kSide * kSide, 2000);
    std::vector<std::byte> packed(rvl_bound(depth.size()));
    packed.resize(rvl_pack(depth, packed.data()));
    std::vector<ros::Bytes> out(6);
    ros::image(camera, {}, "f", depth, out[0]);
    ros::compressed_image(camera, {}, "f", packed, out[1]);
    ros::camera_info(camera, {}, "f", out[2]);
    ros::tf_static({camera}, {"f"}, {}, out[3]);
    ros::joint_state({}, "f", std::vector<std::string>{"x", "y"}, std::vector<double>{1, 2}, out[4]);
    ros::integers(std::vector<std::int64_t>{1, 2, 3}, out[5]);
    return out;
  }();
  return messages;
}

void read(std::span<const std::byte> message) {
  hal::UtcTime stamp;
  (void)ros::read_stamp(message, stamp);
  std::vector<std::uint16_t> depth(kSide * kSide);
  (void)ros::read_image(message, kSide, kSide, depth);
  (void)ros::read_compressed_image(message, kSide, kSide, depth);
  require(depth.size() == kSide * kSide, "a picture keeps its size");
  std::string frame, format;
  (void)ros::read_image_header(message, frame);
  (void)ros::read_compressed_header(message, frame, format);
  require(frame.size() <= message.size() && format.size() <= message.size(), "texts come from the message");
  double positions[2];
  (void)ros::read_joint_state(message, positions);
  std::vector<std::int64_t> values;
  if (ros::read_integers(message, 12, values)) require(values.size() <= 12, "no more values than asked for");
  hal::Intrinsics intrinsics;
  (void)ros::read_camera_info(message, intrinsics, frame);
  std::vector<ros::Transform> transforms;
  if (ros::read_tf(message, transforms)) require(transforms.size() <= message.size(), "transforms come from the message");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  read(std::as_bytes(std::span(data, size)));
  fuzz::Input in(data, size);
  ros::Bytes message = good()[in.u8() % good().size()];
  for (int edits = 0; edits < 8 && !in.empty() && !message.empty(); ++edits) {
    const std::size_t at = in.u16() % message.size();
    if (in.u8() == 0)
      message.resize(at);
    else
      message[at] = static_cast<char>(in.u8());
  }
  read(std::as_bytes(std::span(message)));
  return 0;
}
