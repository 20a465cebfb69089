// Formatting of skeleton rows; shortest numbers that read back to the same float.
#include "daemon/io/csv_file.hpp"

#include <fmt/format.h>

#include <iterator>

#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {

std::string skeleton_csv_header() {
  std::string out = "time_s,utc_ns,state,residual_m";
  for (int d = 0; d < fit::kDofs; ++d) out += "," + std::string(fit::dof_name(d)) + (d < 3 ? "_m" : "_rad");
  for (const fit::Bone& b : fit::bones())
    for (const char axis : {'x', 'y', 'z'}) out += "," + std::string(b.end_joint) + "_" + axis + "_m";
  return out + "\n";
}

void append_skeleton_csv(std::string& out, const SkeletonRow& row) {
  auto to = std::back_inserter(out);
  fmt::format_to(to, "{:.6f},{},{},{}", row.time, row.utc_ns, row.state, static_cast<float>(row.residual));
  for (int d = 0; d < fit::kDofs; ++d) fmt::format_to(to, ",{}", static_cast<float>(row.q[d]));
  for (int j = 0; j < fit::kJoints; ++j) {
    const Eigen::Vector3f p = fit::booth_from_cmu(row.joints.col(j)).cast<float>();
    fmt::format_to(to, ",{},{},{}", p.x(), p.y(), p.z());
  }
  out += '\n';
}

void write_skeleton_csv(const FileTarget& target, std::span<const SkeletonRow> rows) {
  AtomicFile file(target);
  file.write(skeleton_csv_header());
  std::string line;
  for (const SkeletonRow& row : rows) {
    line.clear();
    append_skeleton_csv(line, row);
    file.write(line);
  }
  file.commit();
}

}  // namespace booth::daemon
