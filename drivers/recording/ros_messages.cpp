// Written with Fast-CDR, the serialiser that ROS 2 itself uses; read with bounds checked at every step.
#include "drivers/recording/ros_messages.hpp"

#include <fastcdr/Cdr.h>

#include <cmath>

#include "drivers/recording/cdr_reader.hpp"
#include "drivers/recording/rvl.hpp"

namespace booth::drivers::ros {
namespace {

using eprosima::fastcdr::Cdr;

constexpr std::size_t kMaxTransforms = 10'000, kMaxNames = 10'000;
constexpr const char* kCompressedFormat = "16UC1; compressedDepth rvl";
/// Before the RVL bytes: the transport's own header (a format number and two parameters, which RVL does not use), then columns and rows.
constexpr std::size_t kRvlPrefix = 12 + 8;

class Message {
 public:
  explicit Message(std::size_t capacity) : bytes_(capacity), buffer_(bytes_.data(), bytes_.size()), cdr_(buffer_, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR) {
    cdr_.serialize_encapsulation();
  }
  Cdr& cdr() { return cdr_; }
  void header(hal::UtcTime stamp, const std::string& frame_id) {
    const auto ns = stamp.time_since_epoch().count();
    cdr_ << static_cast<std::int32_t>(ns / 1'000'000'000) << static_cast<std::uint32_t>(ns % 1'000'000'000) << frame_id;
  }
  void finish(Bytes& out) { out.assign(bytes_.data(), bytes_.data() + cdr_.getSerializedDataLength()); }

 private:
  std::vector<char> bytes_;
  eprosima::fastcdr::FastBuffer buffer_;
  Cdr cdr_;
};

/// x, y, z, w of a rotation matrix (row-major), the largest component first for accuracy.
std::array<double, 4> quaternion(const std::array<double, 9>& r) {
  const double trace = r[0] + r[4] + r[8];
  std::array<double, 4> q;
  if (trace > 0) {
    const double s = std::sqrt(trace + 1) * 2;
    q = {(r[7] - r[5]) / s, (r[2] - r[6]) / s, (r[3] - r[1]) / s, s / 4};
  } else if (r[0] > r[4] && r[0] > r[8]) {
    const double s = std::sqrt(1 + r[0] - r[4] - r[8]) * 2;
    q = {s / 4, (r[1] + r[3]) / s, (r[2] + r[6]) / s, (r[7] - r[5]) / s};
  } else if (r[4] > r[8]) {
    const double s = std::sqrt(1 + r[4] - r[0] - r[8]) * 2;
    q = {(r[1] + r[3]) / s, s / 4, (r[5] + r[7]) / s, (r[2] - r[6]) / s};
  } else {
    const double s = std::sqrt(1 + r[8] - r[0] - r[4]) * 2;
    q = {(r[2] + r[6]) / s, (r[5] + r[7]) / s, s / 4, (r[3] - r[1]) / s};
  }
  return q;
}

bool rotation(std::array<double, 4> q, std::array<double, 9>& r) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 0.5 && length < 2)) return false;
  for (double& x : q) x /= length;
  const auto [x, y, z, w] = q;
  r = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),  //
       2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),  //
       2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
  return true;
}

struct Header {
  hal::UtcTime stamp;
  std::string_view frame_id;
};

Header read_header(CdrReader& in) {
  const auto seconds = in.get<std::int32_t>();
  const auto nanoseconds = in.get<std::uint32_t>();
  return {hal::UtcTime(std::chrono::seconds(seconds) + hal::Nanoseconds(nanoseconds)), in.text()};
}

}  // namespace

void image(const hal::CameraDescription& camera, hal::UtcTime stamp, const std::string& frame_id, const std::vector<std::uint16_t>& depth, Bytes& out) {
  static_assert(std::endian::native == std::endian::little, "is_bigendian is written as 0");
  const auto& k = camera.intrinsics;
  const std::size_t size = depth.size() * 2;
  Message m(size + frame_id.size() + 256);
  m.header(stamp, frame_id);
  m.cdr() << static_cast<std::uint32_t>(k.height) << static_cast<std::uint32_t>(k.width) << std::string("16UC1") << std::uint8_t{0}
          << static_cast<std::uint32_t>(2 * k.width) << static_cast<std::uint32_t>(size);
  m.cdr().serializeArray(reinterpret_cast<const std::uint8_t*>(depth.data()), size);
  m.finish(out);
}

void compressed_image(const hal::CameraDescription& camera, hal::UtcTime stamp, const std::string& frame_id, std::span<const std::byte> packed, Bytes& out) {
  Message m(packed.size() + frame_id.size() + 256);
  m.header(stamp, frame_id);
  m.cdr() << std::string(kCompressedFormat) << static_cast<std::uint32_t>(kRvlPrefix + packed.size());
  std::array<std::uint32_t, kRvlPrefix / 4> prefix{0, 0, 0, static_cast<std::uint32_t>(camera.intrinsics.width),
                                                   static_cast<std::uint32_t>(camera.intrinsics.height)};
  m.cdr().serializeArray(reinterpret_cast<const std::uint8_t*>(prefix.data()), kRvlPrefix);
  m.cdr().serializeArray(reinterpret_cast<const std::uint8_t*>(packed.data()), packed.size());
  m.finish(out);
}

void string(const std::string& text, Bytes& out) {
  Message m(text.size() + 64);
  m.cdr() << text;
  m.finish(out);
}

void joint_state(hal::UtcTime stamp, const std::string& frame_id, std::span<const std::string> names, std::span<const double> positions, Bytes& out) {
  std::size_t text = 0;
  for (const auto& n : names) text += n.size() + 8;
  Message m(text + 8 * positions.size() + frame_id.size() + 256);
  m.header(stamp, frame_id);
  m.cdr() << std::vector<std::string>(names.begin(), names.end()) << std::vector<double>(positions.begin(), positions.end());
  m.cdr() << std::vector<double>{} << std::vector<double>{};  // velocity, effort
  m.finish(out);
}

void integers(std::span<const std::int64_t> values, Bytes& out) {
  Message m(8 * values.size() + 256);
  m.cdr() << std::uint32_t{1} << std::string("values") << static_cast<std::uint32_t>(values.size()) << static_cast<std::uint32_t>(values.size())
          << std::uint32_t{0} << std::vector<std::int64_t>(values.begin(), values.end());
  m.finish(out);
}

void camera_info(const hal::CameraDescription& camera, hal::UtcTime stamp, const std::string& frame_id, Bytes& out) {
  const auto& k = camera.intrinsics;
  Message m(frame_id.size() + 1024);
  m.header(stamp, frame_id);
  m.cdr() << static_cast<std::uint32_t>(k.height) << static_cast<std::uint32_t>(k.width) << std::string("plumb_bob")
          << std::vector<double>(k.distortion.begin(), k.distortion.end());
  const std::array<double, 9> matrix{k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1}, rectification{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::array<double, 12> projection{k.fx, 0, k.cx, 0, 0, k.fy, k.cy, 0, 0, 0, 1, 0};
  m.cdr().serializeArray(matrix.data(), matrix.size());
  m.cdr().serializeArray(rectification.data(), rectification.size());
  m.cdr().serializeArray(projection.data(), projection.size());
  for (int i = 0; i < 6; ++i) m.cdr() << std::uint32_t{0};  // no binning, no region of interest
  m.cdr() << false;
  m.finish(out);
}

void tf_static(const std::vector<hal::CameraDescription>& cameras, const std::vector<std::string>& frame_ids, hal::UtcTime stamp, Bytes& out) {
  Message m(1024 + 1024 * cameras.size());
  m.cdr() << static_cast<std::uint32_t>(cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    m.header(stamp, "booth");
    m.cdr() << frame_ids[i];
    for (const double t : cameras[i].camera_to_world.translation) m.cdr() << t;
    for (const double q : quaternion(cameras[i].camera_to_world.rotation)) m.cdr() << q;
  }
  m.finish(out);
}

bool read_stamp(std::span<const std::byte> message, hal::UtcTime& stamp) {
  CdrReader in(message);
  const auto seconds = in.get<std::int32_t>();
  const auto nanoseconds = in.get<std::uint32_t>();
  stamp = hal::UtcTime(std::chrono::seconds(seconds) + hal::Nanoseconds(nanoseconds));
  return in.ok() && seconds >= 0 && nanoseconds < 1'000'000'000;
}

bool read_image(std::span<const std::byte> message, int width, int height, std::vector<std::uint16_t>& depth) noexcept {
  CdrReader in(message);
  read_header(in);
  const auto rows = in.get<std::uint32_t>(), columns = in.get<std::uint32_t>();
  const auto encoding = in.text();
  const auto big_endian = in.get<std::uint8_t>();
  const auto step = in.get<std::uint32_t>();
  const auto pixels = in.octets();
  if (!in.ok() || rows != static_cast<std::uint32_t>(height) || columns != static_cast<std::uint32_t>(width) || (encoding != "16UC1" && encoding != "mono16") ||
      step < 2 * columns || pixels.size() / rows < step)
    return false;
  const bool swap = (big_endian != 0) != (std::endian::native == std::endian::big);
  for (std::size_t y = 0; y < rows; ++y) {
    std::uint16_t* row = depth.data() + y * columns;
    std::memcpy(row, pixels.data() + y * step, 2 * std::size_t{columns});
    if (swap)
      for (std::size_t x = 0; x < columns; ++x) row[x] = static_cast<std::uint16_t>(row[x] << 8 | row[x] >> 8);
  }
  return true;
}

bool read_compressed_image(std::span<const std::byte> message, int width, int height, std::vector<std::uint16_t>& depth) noexcept {
  CdrReader in(message);
  read_header(in);
  const auto format = in.text();
  const auto data = in.octets();
  if (!in.ok() || format != kCompressedFormat || data.size() < kRvlPrefix) return false;
  std::uint32_t columns, rows;
  std::memcpy(&columns, data.data() + 12, 4);
  std::memcpy(&rows, data.data() + 16, 4);
  if (columns != static_cast<std::uint32_t>(width) || rows != static_cast<std::uint32_t>(height)) return false;
  return rvl_unpack(data.subspan(kRvlPrefix), depth);
}

bool read_compressed_header(std::span<const std::byte> message, std::string& frame_id, std::string& format) {
  CdrReader in(message);
  frame_id = read_header(in).frame_id;
  format = in.text();
  return in.ok() && format == kCompressedFormat;
}

bool read_joint_state(std::span<const std::byte> message, std::span<double> positions) {
  CdrReader in(message);
  read_header(in);
  const auto names = in.get<std::uint32_t>();
  if (!in.ok() || names > kMaxNames) return false;
  for (std::uint32_t i = 0; i < names && in.ok(); ++i) in.text();
  if (in.get<std::uint32_t>() != positions.size()) return false;
  for (double& p : positions) p = in.get<double>();
  return in.ok();
}

bool read_integers(std::span<const std::byte> message, std::size_t most, std::vector<std::int64_t>& values) {
  CdrReader in(message);
  const auto dimensions = in.get<std::uint32_t>();
  if (!in.ok() || dimensions > 16) return false;
  for (std::uint32_t i = 0; i < dimensions; ++i) {
    in.text();
    in.get<std::uint32_t>();
    in.get<std::uint32_t>();
  }
  in.get<std::uint32_t>();  // offset
  const auto count = in.get<std::uint32_t>();
  if (!in.ok() || count > most) return false;
  values.clear();
  for (std::uint32_t i = 0; i < count; ++i) values.push_back(in.get<std::int64_t>());
  return in.ok();
}

bool read_image_header(std::span<const std::byte> message, std::string& frame_id) {
  CdrReader in(message);
  const Header header = read_header(in);
  in.get<std::uint32_t>();
  in.get<std::uint32_t>();
  const auto encoding = in.text();
  frame_id = header.frame_id;
  return in.ok() && (encoding == "16UC1" || encoding == "mono16");
}

bool read_camera_info(std::span<const std::byte> message, hal::Intrinsics& intrinsics, std::string& frame_id) {
  CdrReader in(message);
  frame_id = read_header(in).frame_id;
  intrinsics.height = static_cast<int>(in.get<std::uint32_t>());
  intrinsics.width = static_cast<int>(in.get<std::uint32_t>());
  const auto model = in.text();
  const auto count = in.get<std::uint32_t>();
  if (!in.ok() || count > 5 || (count > 0 && model != "plumb_bob")) return false;
  for (std::uint32_t i = 0; i < count; ++i) intrinsics.distortion[i] = in.get<double>();
  std::array<double, 9> k;
  for (double& x : k) x = in.get<double>();
  intrinsics.fx = k[0];
  intrinsics.cx = k[2];
  intrinsics.fy = k[4];
  intrinsics.cy = k[5];
  return in.ok();
}

bool read_tf(std::span<const std::byte> message, std::vector<Transform>& out) {
  CdrReader in(message);
  const auto count = in.get<std::uint32_t>();
  if (count > kMaxTransforms) return false;
  for (std::uint32_t i = 0; i < count && in.ok(); ++i) {
    Transform t;
    t.parent = read_header(in).frame_id;
    t.child = in.text();
    for (double& x : t.child_to_parent.translation) x = in.get<double>();
    std::array<double, 4> q;
    for (double& x : q) x = in.get<double>();
    if (!in.ok() || !rotation(q, t.child_to_parent.rotation)) return false;
    out.push_back(std::move(t));
  }
  return in.ok();
}

}  // namespace booth::drivers::ros
