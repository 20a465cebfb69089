// PLY, OBJ, PCD and XYZ of any bytes: finite points and faces that name them, or one sentence.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/mesh_file.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::require;

struct Format {
  RawCloud (*parse)(std::string_view);
  const char* name;
};
constexpr Format kFormats[] = {{parse_ply, "a.ply"}, {parse_obj, "a.obj"}, {parse_pcd, "a.pcd"}, {parse_xyz, "a.xyz"}};

void parse(const Format& format, const std::string& bytes) {
  try {
    const RawCloud cloud = format.parse(bytes);
    require(cloud.normals.empty() || cloud.normals.size() == cloud.points.size(), "normals are of all points or of none");
    for (const auto& face : cloud.faces)
      for (const auto corner : face) require(corner >= 0 && static_cast<std::size_t>(corner) < cloud.points.size(), "faces name points that there are");
  } catch (const ParseError&) {
  }
}

void read(const Format& format, const std::string& bytes, bool millimetres) {
  static const booth::fuzz::Scratch scratch;
  const auto file = scratch.put(format.name, bytes);
  try {
    const CloudFile cloud = read_cloud_file(file, {.units = millimetres ? Units::millimetres : Units::automatic, .up = UpAxis::y});
    require(cloud.points.cols() > 0 && cloud.points.allFinite(), "points are there and finite");
    require(cloud.normals.cols() == 0 || (cloud.normals.cols() == cloud.points.cols() && cloud.normals.allFinite()), "normals are finite");
    require(cloud.faces.cols() == 0 || (cloud.faces.minCoeff() >= 0 && cloud.faces.maxCoeff() < cloud.points.cols()), "faces name points that there are");
  } catch (const std::runtime_error& e) {
    require(std::string(e.what()).find(format.name) != std::string::npos, "the sentence names the file");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  booth::fuzz::Input in(data, size);
  const unsigned choice = in.u8();
  const auto rest = in.bytes(size);
  const std::string bytes(reinterpret_cast<const char*>(rest.data()), rest.size());
  const Format& format = kFormats[choice % std::size(kFormats)];
  parse(format, bytes);
  read(format, bytes, (choice & 4) != 0);
  return 0;
}
