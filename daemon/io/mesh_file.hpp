// Point clouds and meshes from and to files: PLY, OBJ, PCD and XYZ in, PLY out.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/axes.hpp"

namespace booth::daemon {

enum class Units : std::uint8_t { metres, centimetres, millimetres, automatic };
/// "m", "cm", "mm", "auto"; nothing for any other word.
std::optional<Units> units_from_name(std::string_view name);

struct CloudReadOptions {
  Units units = Units::metres;
  UpAxis up = UpAxis::z;
};

/// Points in the CMU frame, metres, whatever the file's axes and units were.
struct CloudFile {
  Eigen::Matrix3Xf points;
  Eigen::Matrix3Xf normals;   ///< unit; empty when the file has none (zero where a single one is unusable)
  Eigen::Matrix3Xi faces;     ///< triangles; empty for a cloud. Polygons were cut into fans
  std::int64_t dropped = 0;   ///< points that were NaN or infinite, and so are not in `points` (faces that used them neither)
  float metres_per_unit = 1;  ///< what the coordinates were multiplied with
};

/// More than a booth's cameras deliver in 50 frames; what is larger is a mistake or an attack.
inline constexpr std::int64_t kMostCloudPoints = 50'000'000;

/// Format by extension (.ply .obj .pcd .xyz .txt .pts, any case). Throws std::runtime_error with one sentence naming the file, the place in it and what is
/// wrong: unreadable, truncated, counts that the file cannot hold, more than kMostCloudPoints, no finite point, or (Units::metres) extents that can
/// only be other units, with the option that helps.
CloudFile read_cloud_file(const std::filesystem::path& path, const CloudReadOptions& options = {});

/// What a PLY holds. Matrices have one column per vertex or face; CMU frame, metres.
struct PlyMesh {
  const Eigen::Matrix3Xf& points;
  const Eigen::Matrix3Xf* normals = nullptr;
  const Eigen::Matrix3Xi* faces = nullptr;
  const Eigen::Matrix<std::uint8_t, 3, Eigen::Dynamic>* colours = nullptr;  ///< red, green, blue
};

/// Binary little-endian PLY; points and normals are turned to the axes asked for. `comment` (one line) goes into the header.
/// Throws std::runtime_error as AtomicFile does, std::invalid_argument when sizes do not agree.
void write_ply(const FileTarget& target, const PlyMesh& mesh, UpAxis up = UpAxis::z, const std::string& comment = {});

}  // namespace booth::daemon
