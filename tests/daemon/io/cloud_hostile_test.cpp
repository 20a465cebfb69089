// Broken and hostile cloud files: one sentence that names the file, never a crash, never a huge allocation.
#include <gmock/gmock.h>

#include <cstring>
#include <random>

#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/mesh_file.hpp"
#include "tests/daemon/io/scratch_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using tests::message_of;
using tests::ScratchFolder;

struct Case {
  const char* name;  ///< file name; its extension picks the parser
  std::string contents;
  const char* says;
};

std::string ply(const std::string& body, const std::string& format = "ascii") { return "ply\nformat " + format + " 1.0\n" + body; }

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kPcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";

std::vector<Case> cases() {
  return {
      {"empty.ply", "", "it is empty"},
      {"noise.ply", "\x89PNG\r\n", "does not begin with 'ply'"},
      {"cut.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "no end_header"},
      {"format.ply", "ply\nformat morse 1.0\nend_header\n", "unknown format 'morse'"},
      {"none.ply", "ply\nelement vertex 1\n" + kXyz + "end_header\n0 0 0\n", "no format line"},
      {"huge.ply", ply("element vertex 4000000000\n" + kXyz + "end_header\n0 0 0\n"), "at most 50000000"},
      {"overflow.ply", ply("element vertex 99999999999999999999999\n" + kXyz + "end_header\n0 0 0\n"), "needs a name and a count"},
      {"claims.ply", ply("element vertex 40000000\n" + kXyz + "end_header\n0 0 0\n", "binary_little_endian"), "truncated"},
      {"comment.ply", ply("element vertex 2\n" + kXyz + "end_header\n0 0 0 # a\n1 1\n"), "'#' is not a number"},
      {"short.ply", ply("element vertex 2\n" + kXyz + "end_header\n0.000 0.000 0.000\n1 1\n"), "ends early"},
      {"word.ply", ply("element vertex 1\n" + kXyz + "end_header\n0 zero 0\n"), "'zero' is not a number"},
      {"twice.ply", ply("element vertex 1\n" + kXyz + kXyz + "end_header\n0 0 0 0 0 0\n"), "more than one property x"},
      {"flat.ply", ply("element vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n"), "no property z"},
      {"type.ply", ply("element vertex 1\nproperty quaternion x\nend_header\n0 0\n"), "unknown type 'quaternion'"},
      {"list.ply", ply("element vertex 1\n" + kXyz + "element face 1\nproperty list uint int vertex_indices\nend_header\n0 0 0\n4000000000 0 1 2\n"),
       "at most 50000000"},
      {"float-list.ply", ply("element vertex 1\n" + kXyz + "element face 1\nproperty list float int vertex_indices\nend_header\n0 0 0\n3 0 1 2\n"),
       "integer type"},
      {"index.ply", ply("element vertex 1\n" + kXyz + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 1\n"),
       "does not exist"},
      {"negative.ply", ply("element vertex 1\n" + kXyz + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 -1\n"),
       "does not exist"},
      {"order.ply", ply("element face 0\nproperty list uchar int vertex_indices\nelement vertex 1\n" + kXyz + "end_header\n0 0 0\n"), "faces before vertices"},
      {"no-vertices.ply", ply("end_header\n"), "no element vertex"},
      {"zero.ply", ply("element vertex 0\n" + kXyz + "end_header\n"), "no points"},
      {"nan.ply", ply("element vertex 2\n" + kXyz + "end_header\nnan nan nan\nnan nan inf\n"), "none of its 2 points is finite"},
      {"letters.obj", "v 0 0 x\n", "'x' is not a number"},
      {"corner.obj", "v 0 0 0\nf 1 2 3\n", "line 2 names a vertex that does not exist"},
      {"zero-corner.obj", "v 0 0 0\nf 0 0 0\n", "does not exist"},
      {"far-corner.obj", "v 0 0 0\nf 1 1 -9223372036854775808\n", "does not exist"},
      {"two-corners.obj", "v 0 0 0\nf 1 1\n", "fewer than three corners"},
      {"nothing.obj", "# nothing\n", "no points"},
      {"one.xyz", "0 0 0\n1 2\n", "line 2: a point needs three numbers"},
      {"text.xyz", "hello world and all\n", "'hello' is not a number"},
      {"nodata.pcd", kPcd + "POINTS 1\n", "no DATA line"},
      {"fields.pcd", "FIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nPOINTS 1\nDATA ascii\n0 0\n", "fields x, y and z"},
      {"integers.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE I I I\nCOUNT 1 1 1\nPOINTS 1\nDATA ascii\n0 0 0\n", "not a single float or double"},
      {"wide.pcd", "FIELDS x y z w\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 65535\nPOINTS 1000\nDATA ascii\n" + std::string(60'000, '\n'), "truncated"},
      {"huge.pcd", kPcd + "WIDTH 4294967295\nHEIGHT 4294967295\nDATA binary\nxxxx", "at most 50000000"},
      {"cut.pcd", kPcd + "POINTS 3\nDATA binary\n0123456789", "truncated"},
      {"kind.pcd", kPcd + "POINTS 3\nDATA gzip\n", "known are ascii, binary"},
      {"bomb.pcd", kPcd + "POINTS 40000000\nDATA binary_compressed\n" + std::string("\x04\0\0\0\0\x84\xd7\x1c", 8) + "abcd", "impossible size"},
      {"lzf.pcd", kPcd + "POINTS 2\nDATA binary_compressed\n" + std::string("\x03\0\0\0\x18\0\0\0\xff\xff\xff", 11), "compressed part is broken"},
      {"unknown.stl", "solid\n", "known are .ply, .obj, .pcd, .xyz"},
      {"tiny.xyz", "0 0 0\n", "too small for a person"},
  };
}

TEST(HostileCloud, EachIsRefusedWithOneSentence) {
  ScratchFolder folder;
  for (const Case& c : cases()) {
    const std::string text = message_of([&] { read_cloud_file(folder.put(c.name, c.contents)); });
    EXPECT_THAT(text, HasSubstr(c.name));
    EXPECT_THAT(text, HasSubstr(c.says)) << c.name;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
  }
}

TEST(HostileCloud, MissingFilesAndFoldersAreNamed) {
  ScratchFolder folder;
  EXPECT_THAT(message_of([&] { read_cloud_file(folder / "none.ply"); }), HasSubstr("No such file"));
  std::filesystem::create_directory(folder / "dir.ply");
  EXPECT_THAT(message_of([&] { read_cloud_file(folder / "dir.ply"); }), HasSubstr("it is a folder"));
}

/// Truncated anywhere and with any byte changed, a parser returns or throws ParseError; sanitizers watch the rest.
template <typename Parse>
void torture(const std::string& good, Parse parse) {
  ASSERT_NO_THROW(parse(good));
  std::mt19937 random(7);
  const auto survive = [&](const std::string& bad) {
    try {
      const RawCloud c = parse(bad);
      for (const auto& f : c.faces)
        for (const int i : f) ASSERT_LT(static_cast<std::size_t>(i), c.points.size());
      ASSERT_TRUE(c.normals.empty() || c.normals.size() == c.points.size());
    } catch (const ParseError&) {
    }
  };
  for (std::size_t n = 0; n < good.size(); ++n) survive(good.substr(0, n));
  for (int round = 0; round < 20'000; ++round) {
    std::string bad = good;
    for (unsigned k = 0; k <= random() % 3; ++k) bad[random() % bad.size()] = static_cast<char>(random());
    survive(bad);
  }
}

std::string bytes_of(std::initializer_list<float> values) {
  std::string s;
  for (const float v : values) s.append(reinterpret_cast<const char*>(&v), 4);
  return s;
}

TEST(HostileCloud, NoTruncationOrChangedByteIsFatal) {
  const std::string rows = bytes_of({0, 1, 2, 3, 4, 5, 6, 7, 8});
  torture(ply("element vertex 3\n" + kXyz + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 1 1\n2 2 2\n3 0 1 2\n"), parse_ply);
  torture(ply("element vertex 3\n" + kXyz + "element face 1\nproperty list uchar uchar vertex_indices\nend_header\n" + rows + std::string("\x03\0\x01\x02", 4),
              "binary_big_endian"),
          parse_ply);
  torture("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 -1//1\n", parse_obj);
  torture("# c\n0 0 0 0 0 1\n1 1 1 0 1 0\n", parse_xyz);
  torture(kPcd + "POINTS 3\nDATA ascii\n0 0 0\n1 1 1\n2 2 2\n", parse_pcd);
  torture(kPcd + "POINTS 3\nDATA binary\n" + rows, parse_pcd);
  const std::string packed = std::string(1, 19) + rows.substr(0, 20) + std::string(1, 15) + rows.substr(20);
  torture(kPcd + "POINTS 3\nDATA binary_compressed\n" + std::string({static_cast<char>(packed.size()), 0, 0, 0, 36, 0, 0, 0}) + packed, parse_pcd);
}

}  // namespace
}  // namespace booth::daemon
