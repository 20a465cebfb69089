// Reference pages that are made from the code: equal to what the code says, and rewritten by BOOTHD_UPDATE_REFERENCE=1.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "daemon/health/messages.hpp"
#include "fit/body/skeleton.hpp"
#include "tests/house/command.hpp"
#include "tests/house/idl_page.hpp"

namespace booth::tests {
namespace {

void expect_page(const std::string& path, const std::string& generated) {
  const std::string full = std::string(BOOTH_SOURCE_DIR) + "/" + path;
  if (std::getenv("BOOTHD_UPDATE_REFERENCE") != nullptr) std::ofstream(full, std::ios::binary) << generated;
  std::ifstream in(full, std::ios::binary);
  const std::string page{std::istreambuf_iterator<char>(in), {}};
  EXPECT_TRUE(page == generated) << path << " is not what the code says; run BOOTHD_UPDATE_REFERENCE=1 ctest -R reference";
}

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4f", std::abs(x) < 5e-5 ? 0.0 : x);  // never "-0.0000"
  return text;
}

std::string skeleton_page() {
  std::string page =
      "# The skeleton\n\n"
      "Made from fit/body/skeleton.hpp by tests/house/reference_test.cpp; do not edit.\n\n"
      "A pose is q, 36 numbers in the CMU frame (y up, z forward, x left): metres for q[0..2], radians otherwise. At q = 0 the body stands in a\n"
      "T-pose with its root at the origin. The root turns by Y(root_ry) X(root_rx) Z(root_rz); any other bone by C Z(rz) Y(ry) X(rx) C^T inside its\n"
      "parent, C = Z(az) Y(ay) X(ax) from the axis column; angles that a bone does not have are zero. Left is the person's left. A point of the CMU\n"
      "frame lies in the booth frame (x forward, y left, z up) at x = z_cmu, y = x_cmu, z = y_cmu.\n\n"
      "## Bones and joints\n\n"
      "Bone b ends in joint b; it starts where its parent ends. Main joints are those that tables of errors average.\n\n"
      "| b | bone | parent | joint at its end | main | degrees of freedom (index in q) | axis (degrees) | average vector (m, CMU frame) |\n"
      "|---|---|---|---|---|---|---|---|\n";
  const auto bones = fit::bones();
  const auto main = fit::main_joints();
  for (int b = 0; b < fit::kBones; ++b) {
    const fit::Bone& bone = bones[static_cast<std::size_t>(b)];
    std::string dofs;
    const auto add = [&](int d) { dofs += (dofs.empty() ? "" : ", ") + std::string(fit::dof_name(d)) + " (" + std::to_string(d) + ")"; };
    if (b == 0)
      for (int d = 0; d < 3; ++d) add(d);
    for (const int d : bone.dof)
      if (d >= 0) add(d);
    const auto v = fit::average_bone_vectors().col(b);
    page += "| " + std::to_string(b) + " | " + std::string(bone.name) + " | " +
            (bone.parent < 0 ? "-" : std::string(bones[static_cast<std::size_t>(bone.parent)].name)) + " | " + std::string(bone.end_joint) + " | " +
            (std::find(main.begin(), main.end(), b) == main.end() ? "" : "yes") + " | " + (dofs.empty() ? "fixed" : dofs) + " | ";
    for (std::size_t i = 0; i < 3; ++i) page += (i == 0 ? "" : " ") + std::to_string(static_cast<int>(bone.axis_deg[i]));
    page += " | " + number(v.x()) + " " + number(v.y()) + " " + number(v.z()) + " |\n";
  }
  page += "\n## Degrees of freedom\n\n| index | name | unit |\n|---|---|---|\n";
  for (int d = 0; d < fit::kDofs; ++d) page += "| " + std::to_string(d) + " | " + std::string(fit::dof_name(d)) + " | " + (d < 3 ? "m" : "rad") + " |\n";
  return page;
}

TEST(Reference, SkeletonPageIsWhatTheCodeSays) { expect_page("docs/reference/skeleton.md", skeleton_page()); }

std::string text_of(const std::string& path) {
  std::ifstream in(std::string(BOOTH_SOURCE_DIR) + "/" + path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Reference, DdsPageHasTheTypesOfTheIdl) {
  // What stands above the marker is written by people.
  const std::string marker = "<!-- From here on made from daemon/dds/idl/booth.idl by tests/house/reference_test.cpp; do not edit. -->\n";
  const std::string page = text_of("docs/reference/dds.md");
  const auto at = page.find(marker);
  ASSERT_NE(at, std::string::npos);
  const std::string types = types_of_idl(text_of("daemon/dds/idl/booth.idl"));
  for (const char* row : {"### Skeleton\n", "| `q` | `double[DOFS]` |", "| `booth` | `string<32>` | key. ", "| `DOFS` | 36 |", "STATE_IDLE"})
    EXPECT_NE(types.find(row), std::string::npos) << row;
  expect_page("docs/reference/dds.md", page.substr(0, at) + marker + types);
}

TEST(Reference, Ros2PageHasTheTypesOfItsIdl) {
  const std::string marker = "<!-- From here on made from daemon/dds/idl/ros2/ros2_messages.idl by tests/house/reference_test.cpp; do not edit. -->\n";
  const std::string page = text_of("docs/reference/ros2.md");
  const auto at = page.find(marker);
  ASSERT_NE(at, std::string::npos);
  const std::string types = types_of_idl(text_of("daemon/dds/idl/ros2/ros2_messages.idl"));
  for (const char* row : {"### sensor_msgs/msg/JointState\n", "| `name` | `sequence<string>` |", "| `header` | `std_msgs/msg/Header` |"})
    EXPECT_NE(types.find(row), std::string::npos) << row;
  EXPECT_EQ(types.find("| constant |"), std::string::npos) << "there are none";
  expect_page("docs/reference/ros2.md", page.substr(0, at) + marker + types);
}

TEST(Reference, MessagesPageIsWhatTheTableSays) { expect_page("docs/reference/messages.md", daemon::messages_page()); }

TEST(Reference, DependenciesPageIsWhatTheListSays) {
  const CommandResult table = run_in_source_tree("toolchain/install-dependencies --table");
  ASSERT_EQ(table.status, 0) << table.output;
  expect_page("docs/reference/dependencies.md", table.output);
}

TEST(Reference, EveryPackageThatTheBuildLooksForIsInTheList) {
  // find_package and pkg_check_modules names, and the Debian package that brings each.
  const CommandResult found = run_in_source_tree(
      "grep -rhoE 'find_package\\([A-Za-z0-9_]+|pkg_check_modules\\([A-Z_]+ .*' --include=CMakeLists.txt . | grep -v '^./build' | sed -E 's/.*\\(//' | sort "
      "-u");
  ASSERT_EQ(found.status, 0);
  const CommandResult list = run_in_source_tree("toolchain/install-dependencies --table");
  const std::vector<std::pair<std::string, std::string>> debian{{"Eigen3", "libeigen3-dev"},
                                                                {"PkgConfig", "pkg-config"},
                                                                {"PNG", "libpng-dev"},
                                                                {"ZLIB", "zlib1g-dev"},
                                                                {"fmt", "libfmt-dev"},
                                                                {"nlohmann_json", "nlohmann-json3-dev"},
                                                                {"GTest", "libgtest-dev"},
                                                                {"assimp", "libassimp-dev"},
                                                                {"CLI11", "libcli11-dev"},
                                                                {"CycloneDDS", "cyclonedds-dev"},
                                                                {"tomlplusplus", "libtomlplusplus-dev"},
                                                                {"SYSTEMD", "libsystemd-dev"},
                                                                {"OpenSSL", "libssl-dev"},
                                                                {"SECCOMP", "libseccomp-dev"},
                                                                {"fastcdr", "libfastcdr-dev"},
                                                                {"SQLite3", "libsqlite3-dev"},
                                                                {"SQLITE", "libsqlite3-dev"},
                                                                {"LIBUSB", "libusb-1.0-0-dev"},
                                                                {"LIBGPIOD", "libgpiod-dev"},
                                                                {"ZSTD", "libzstd-dev"},
                                                                {"SODIUM", "libsodium-dev"},
                                                                {"zstd", "libzstd-dev"},
                                                                {"benchmark", "libbenchmark-dev"},
                                                                {"rapidcheck", "librapidcheck-dev"},
                                                                {"FLANN", "libflann-dev"},
                                                                {"Threads", "build-essential"},
                                                                {"Pagmo", "libpagmo-dev"},
                                                                {"NLOPT", "libnlopt-cxx-dev"},
                                                                {"Ceres", "libceres-dev"},
                                                                {"flann", "libflann-dev"},
                                                                {"fastrtps", "libfastrtps-dev"}};
  std::istringstream names(found.output);
  for (std::string line; std::getline(names, line);) {
    const std::string name = line.substr(0, line.find(' '));
    const auto it = std::find_if(debian.begin(), debian.end(), [&](const auto& d) { return d.first == name; });
    ASSERT_NE(it, debian.end()) << name << ": say here which Debian package brings it";
    EXPECT_NE(list.output.find("| " + it->second + " |"), std::string::npos) << it->second << " is missing in toolchain/packages.txt";
  }
}

}  // namespace
}  // namespace booth::tests
