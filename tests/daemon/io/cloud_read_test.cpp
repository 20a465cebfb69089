// Every cloud format gives the same points, in the CMU frame and metres, whatever the file's encoding, axes and units.
#include <gmock/gmock.h>

#include <bit>
#include <cstring>

#include "daemon/io/mesh_file.hpp"
#include "tests/daemon/io/scratch_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using tests::message_of;
using tests::ScratchFolder;

/// Two triangles that stand 1.8 m high, booth frame; so that a wrong axis, order or unit shows.
constexpr std::array<std::array<float, 3>, 4> kBooth{{{0.25f, 0.5f, 0}, {0.25f, -0.5f, 0}, {-0.125f, -0.5f, 1.75f}, {-0.125f, 0.5f, 1.75f}}};

Eigen::Matrix3Xf expected() {
  Eigen::Matrix3Xf m(3, 4);
  for (int i = 0; i < 4; ++i) m.col(i) << kBooth[i][1], kBooth[i][2], kBooth[i][0];  // CMU: x left, y up, z forward
  return m;
}

template <typename T>
std::string raw(T value, bool big) {
  std::array<char, sizeof(T)> b;
  std::memcpy(b.data(), &value, sizeof(T));
  if (big) std::reverse(b.begin(), b.end());
  return {b.data(), b.size()};
}

/// Doubles, an extra property before and between, normals, an unknown element with a list, polygons as a quad.
std::string binary_ply(bool big) {
  std::string s = std::string("ply\nformat ") + (big ? "binary_big_endian" : "binary_little_endian") +
                  " 1.0\ncomment made by hand\nelement vertex 4\nproperty uchar quality\nproperty double x\nproperty double y\nproperty float time\n"
                  "property double z\nproperty float nx\nproperty float ny\nproperty float nz\nelement strip 2\nproperty list ushort short ids\n"
                  "element face 1\nproperty uchar flags\nproperty list uchar uint vertex_indices\nend_header\n";
  for (const auto& p : kBooth)
    s += raw<std::uint8_t>(7, big) + raw<double>(p[0], big) + raw<double>(p[1], big) + raw<float>(1e9f, big) + raw<double>(p[2], big) + raw<float>(0, big) +
         raw<float>(0, big) + raw<float>(2, big);
  s += raw<std::uint16_t>(2, big) + raw<std::int16_t>(-3, big) + raw<std::int16_t>(4, big) + raw<std::uint16_t>(0, big);
  s += raw<std::uint8_t>(1, big) + raw<std::uint8_t>(4, big);
  for (std::uint32_t i = 0; i < 4; ++i) s += raw(i, big);
  return s;
}

TEST(CloudFile, BinaryPlyOfBothByteOrders) {
  ScratchFolder folder;
  for (const bool big : {false, true}) {
    const CloudFile c = read_cloud_file(folder.put("a.ply", binary_ply(big)));
    EXPECT_EQ(c.points, expected());
    ASSERT_EQ(c.normals.cols(), 4);
    EXPECT_TRUE(c.normals.col(0).isApprox(Eigen::Vector3f::UnitY())) << "up in the file, made unit length";
    ASSERT_EQ(c.faces.cols(), 2) << "the quad as two triangles";
    EXPECT_EQ(c.faces.col(1), Eigen::Vector3i(0, 2, 3));
    EXPECT_EQ(c.dropped, 0);
  }
}

TEST(CloudFile, AsciiPlyWithWindowsLineEnds) {
  ScratchFolder folder;
  const CloudFile c = read_cloud_file(folder.put("a.PLY",
                                                 "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
                                                 "element face 1\r\nproperty list uchar int vertex_index\r\nend_header\r\n"
                                                 "0.25 0.5 0\r\n.25 -5e-1 0\r\n-0.125 -0.5 1.75\r\n-0.125 +0.5 1.75\r\n3 0 1 2\r\n"));
  EXPECT_EQ(c.points, expected());
  EXPECT_EQ(c.faces.cols(), 1);
  EXPECT_EQ(c.normals.cols(), 0);
}

TEST(CloudFile, ObjWithNegativeIndicesNormalsAndTexture) {
  ScratchFolder folder;
  const CloudFile c = read_cloud_file(folder.put("a.obj",
                                                 "# a comment\nmtllib x.mtl\no body\nv 0.25 0.5 0 1.0 0.5 0.5\nv 0.25 -0.5 0\nv -0.125 -0.5 1.75\nv -0.125 0.5 "
                                                 "1.75\nvt 0 0\nvn 0 0 1\nvn 0 0 1\nvn 0 0 1\nvn 0 "
                                                 "0 1\ns off\nf 1/1/1 2/1/2 3//3\nf -4 -2 -1\n"));
  EXPECT_EQ(c.points, expected());
  EXPECT_EQ(c.normals.cols(), 4);
  ASSERT_EQ(c.faces.cols(), 2);
  EXPECT_EQ(c.faces.col(1), Eigen::Vector3i(0, 2, 3));
}

TEST(CloudFile, XyzWithCommentsCommasAndColours) {
  ScratchFolder folder;
  const CloudFile c =
      read_cloud_file(folder.put("a.xyz", "4\n# x y z r g b\n0.25,0.5,0,255,0,0\n0.25;-0.5;0 1 2 3\n\n-0.125\t-0.5\t1.75 9 9 9\n-0.125 0.5 1.75 0 0 1"));
  EXPECT_EQ(c.points, expected());
  EXPECT_EQ(c.normals.cols(), 0) << "colours are no normals";
}

std::string pcd_header(const std::string& data) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y z\nSIZE 4 4 4 4\nTYPE U F F F\nCOUNT 1 1 1 1\nWIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA " +
         data + "\n";
}

TEST(CloudFile, PcdTextBinaryAndCompressed) {
  ScratchFolder folder;
  std::string text, rows, columns;
  for (const auto& p : kBooth) {
    text += "16711680 " + std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + "\n";
    rows += raw<std::uint32_t>(0xff0000, false);
    for (const float v : p) rows += raw(v, false);
  }
  for (int i = 0; i < 4; ++i) columns += raw<std::uint32_t>(0, false);  // 16 equal bytes: a run, so that a back reference is tested
  for (int axis = 0; axis < 3; ++axis)
    for (const auto& p : kBooth) columns += raw(p[axis], false);
  // One literal zero, a copy of 15 bytes from one byte back (length 7 + 6 + 2), then literals of at most 32 bytes.
  std::string packed = std::string("\0\0", 2) + std::string("\xe0\x06\x00", 3);
  for (std::size_t at = 16; at < columns.size(); at += 32) {
    const std::string part = columns.substr(at, 32);
    packed += static_cast<char>(part.size() - 1) + part;
  }
  const std::string sizes =
      raw<std::uint32_t>(static_cast<std::uint32_t>(packed.size()), false) + raw<std::uint32_t>(static_cast<std::uint32_t>(columns.size()), false);

  EXPECT_EQ(read_cloud_file(folder.put("a.pcd", pcd_header("ascii") + text)).points, expected());
  EXPECT_EQ(read_cloud_file(folder.put("a.pcd", pcd_header("binary") + rows)).points, expected());
  EXPECT_EQ(read_cloud_file(folder.put("a.pcd", pcd_header("binary_compressed") + sizes + packed)).points, expected());
}

TEST(CloudFile, YUpFilesAreTheCmuFrameItself) {
  ScratchFolder folder;
  const CloudFile c =
      read_cloud_file(folder.put("a.xyz", "0.5 0 0.25\n-0.5 0 0.25\n-0.5 1.75 -0.125\n0.5 1.75 -0.125\n"), {.units = Units::metres, .up = UpAxis::y});
  EXPECT_EQ(c.points, expected());
}

TEST(CloudFile, DropsAndCountsWhatIsNoNumberAndTheFacesThatUseIt) {
  ScratchFolder folder;
  const CloudFile c = read_cloud_file(
      folder.put("a.obj", "v nan 0 0\nv 0.25 0.5 0\nv 0.25 -0.5 0\nv inf 0 0\nv -0.125 -0.5 1.75\nv -0.125 0.5 1.75\nv 1e999 0 0\nf 1 2 3\nf 2 3 5\n"));
  EXPECT_EQ(c.points, expected());
  EXPECT_EQ(c.dropped, 3);
  ASSERT_EQ(c.faces.cols(), 1);
  EXPECT_EQ(c.faces.col(0), Eigen::Vector3i(0, 1, 2)) << "renumbered";
}

TEST(CloudFile, MillimetresAreSaidSoAndConvertedWhenAskedFor) {
  ScratchFolder folder;
  const auto path = folder.put("mm.xyz", "250 500 0\n250 -500 0\n-125 -500 1750\n-125 500 1750\n");
  const std::string text = message_of([&] { read_cloud_file(path); });
  EXPECT_THAT(text, HasSubstr("mm.xyz"));
  EXPECT_THAT(text, HasSubstr("millimetres: give --units mm"));
  for (const Units units : {Units::millimetres, Units::automatic}) {
    const CloudFile c = read_cloud_file(path, {.units = units});
    EXPECT_TRUE(c.points.isApprox(expected(), 1e-6f));
    EXPECT_FLOAT_EQ(c.metres_per_unit, 0.001f);
  }
}

TEST(CloudFile, OtherUnitsAreNeverTakenForMetres) {
  ScratchFolder folder;
  const auto centimetres = folder.put("cm.xyz", "25 50 0\n25 -50 0\n-12.5 -50 175\n-12.5 50 175\n");
  EXPECT_THAT(message_of([&] { read_cloud_file(centimetres); }), HasSubstr("centimetres: give --units cm"));
  EXPECT_TRUE(read_cloud_file(centimetres, {.units = Units::automatic}).points.isApprox(expected(), 1e-6f));
  const auto metres = folder.put("m.xyz", "0.25 0.5 0\n0.25 -0.5 0\n-0.125 -0.5 1.75\n-0.125 0.5 1.75\n");
  EXPECT_THAT(message_of([&] { read_cloud_file(metres, {.units = Units::millimetres}); }), HasSubstr("too small for a person"));
  EXPECT_EQ(read_cloud_file(metres, {.units = Units::automatic}).points, expected());
  const auto planet = folder.put("planet.xyz", "0 0 0\n6e6 0 0\n0 6e6 0\n");
  EXPECT_THAT(message_of([&] { read_cloud_file(planet, {.units = Units::automatic}); }), HasSubstr("larger than any stage"));
}

}  // namespace
}  // namespace booth::daemon
