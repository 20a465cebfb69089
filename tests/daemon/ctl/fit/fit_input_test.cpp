// What `boothctl fit` makes of the files it is given.
#include "daemon/ctl/fit_input.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include "fit/body/body_model.hpp"
#include "tests/daemon/io/scratch_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using tests::message_of;
using tests::ScratchFolder;

struct Body {
  fit::Vertices vertices, normals;
  fit::Faces faces;
  Body() {
    const auto model = tests::capsule_body();
    model->shaped(fit::ShapeVector(), vertices);
    faces = model->data().faces;
    fit::vertex_normals(vertices, faces, normals);
  }
};

TEST(SampleSurface, SpreadsPointsByAreaNotByTriangle) {
  // A wide and a narrow rectangle in one plane; the narrow one is cut into many more triangles.
  Eigen::Matrix3Xf v(3, 4 + 2 * 101);
  Eigen::Matrix3Xi f(3, 2 + 200);
  v.leftCols(4) << 0, 3, 3, 0, 0, 0, 1, 1, 0, 0, 0, 0;
  f.col(0) << 0, 1, 2;
  f.col(1) << 0, 2, 3;
  for (int i = 0; i <= 100; ++i) {
    v.col(4 + 2 * i) << 5, 0.01f * static_cast<float>(i), 0;
    v.col(5 + 2 * i) << 6, 0.01f * static_cast<float>(i), 0;
    if (i == 100) break;
    f.col(2 + 2 * i) << 4 + 2 * i, 5 + 2 * i, 7 + 2 * i;
    f.col(3 + 2 * i) << 4 + 2 * i, 7 + 2 * i, 6 + 2 * i;
  }
  Eigen::Matrix3Xf points, normals;
  sample_surface(v, f, 4000, points, normals);
  ASSERT_EQ(points.cols(), 4000);
  EXPECT_NEAR((points.row(0).array() > 4).count(), 1000, 2);
  EXPECT_NEAR((points.row(0).array() < 1.5f).count(), 1500, 40) << "even within a triangle, too";
  EXPECT_NEAR((points.row(0).array() < 3 && points.row(1).array() < 0.5f).count(), 1500, 40);
  for (int i = 0; i < 4000; ++i) ASSERT_TRUE(normals.col(i).isApprox(Eigen::Vector3f::UnitZ()));
}

TEST(SampleSurface, GivesNothingWithoutArea) {
  Eigen::Matrix3Xf v = Eigen::Matrix3Xf::Zero(3, 3), points, normals;
  Eigen::Matrix3Xi f(3, 1);
  f << 0, 1, 2;
  sample_surface(v, f, 100, points, normals);
  EXPECT_EQ(points.cols(), 0);
}

TEST(FitInput, AMeshTurnedInsideOutStillHasOutwardNormals) {
  ScratchFolder folder;
  Body body;
  write_ply(folder / "good.ply", {body.vertices, nullptr, &body.faces});
  body.faces.row(1).swap(body.faces.row(2));
  write_ply(folder / "bad.ply", {body.vertices, nullptr, &body.faces});
  const FitInput good = read_fit_input({folder / "good.ply"}, {}), bad = read_fit_input({folder / "bad.ply"}, {});
  ASSERT_EQ(good.normals.cols(), bad.normals.cols());
  EXPECT_THAT(good.notes, ::testing::Not(::testing::Contains(HasSubstr("turned round"))));
  EXPECT_THAT(bad.notes, ::testing::Contains(HasSubstr("turned round")));
  // On the head's top they point up.
  Eigen::Index top;
  bad.points.row(1).maxCoeff(&top);
  EXPECT_GT(bad.normals(1, top), 0.5f);
}

TEST(FitInput, NormalsThatContradictEachOtherAreNotBelieved) {
  ScratchFolder folder;
  Body body;
  for (Eigen::Index i = 0; i < body.normals.cols(); i += 2) body.normals.col(i) *= -1;
  write_ply(folder / "a.ply", {body.vertices, &body.normals});
  const FitInput input = read_fit_input({folder / "a.ply"}, {});
  EXPECT_EQ(input.normals.cols(), 0);
  EXPECT_THAT(input.notes, ::testing::Contains(HasSubstr("contradict")));
}

TEST(FitInput, PutsFilesOfOneMomentTogetherAndKeepsNormalsOnlyIfAllHaveThem) {
  ScratchFolder folder;
  const Body body;
  write_ply(folder / "with.ply", {body.vertices, &body.normals});
  write_ply(folder / "without.ply", {body.vertices});
  const Eigen::Index n = body.vertices.cols();
  EXPECT_EQ(read_fit_input({folder / "with.ply", folder / "with.ply"}, {}).normals.cols(), 2 * n);
  for (const bool first : {true, false}) {
    const FitInput mixed = read_fit_input({folder / (first ? "with.ply" : "without.ply"), folder / (first ? "without.ply" : "with.ply")}, {});
    EXPECT_EQ(mixed.points.cols(), 2 * n);
    EXPECT_EQ(mixed.normals.cols(), 0);
  }
}

TEST(FitInput, RefusesAHandfulOfPoints) {
  ScratchFolder folder;
  EXPECT_THAT(message_of([&] { read_fit_input({folder.put("a.xyz", "0 0 0\n0 0 1\n0 0 1.8\n")}, {}); }), HasSubstr("only 3 points"));
}

TEST(Viewpoints, AreTheCamerasCentresInTheCmuFrame) {
  ScratchFolder folder;
  const auto path = folder.put("calibration.toml",
                               "version = 1\n[[camera]]\nname = \"a\"\ncamera_to_world = [[1, 0, 0, 2.5], [0, 1, 0, -1], [0, 0, 1, 1.6], [0, 0, 0, 1]]\n"
                               "[[camera]]\ncamera_to_world = [[1,0,0,0.0],[0,1,0,3.0],[0,0,1,0.0],[0,0,0,1.0]]\n");
  const auto booth = read_viewpoints(path, UpAxis::z);
  ASSERT_EQ(booth.size(), 2u);
  EXPECT_EQ(booth[0], Eigen::Vector3f(-1, 1.6f, 2.5f));
  EXPECT_EQ(read_viewpoints(path, UpAxis::y)[0], Eigen::Vector3f(2.5f, -1, 1.6f));
}

TEST(Viewpoints, ErrorsNameFileAndLine) {
  ScratchFolder folder;
  const auto says = [&](const std::string& contents) { return message_of([&] { read_viewpoints(folder.put("c.toml", contents), UpAxis::z); }); };
  EXPECT_THAT(says("a = [1,\n"), HasSubstr("c.toml:"));
  EXPECT_THAT(says(""), HasSubstr("no [[camera]] table"));
  EXPECT_THAT(says("camera = 3\n"), HasSubstr("no [[camera]] table"));
  EXPECT_THAT(says("\n[[camera]]\nname = \"a\"\n"), HasSubstr("c.toml:2: camera_to_world is missing"));
  EXPECT_THAT(says("[[camera]]\ncamera_to_world = [[1, 0, 0, 1]]\n"), HasSubstr("c.toml:2: camera_to_world must have four rows"));
  EXPECT_THAT(says("[[camera]]\ncamera_to_world = [[1,0,0,nan],[0,1,0,3.0],[0,0,1,0.0],[0,0,0,1.0]]\n"), HasSubstr("must have four rows"));
}

TEST(InitialPose, IsAnArrayOrAnObjectWithQ) {
  ScratchFolder folder;
  std::string numbers = "[0.5";
  for (int i = 1; i < 36; ++i) numbers += "," + std::to_string(i);
  numbers += "]";
  for (const std::string& text : {numbers, "{\"sex\": \"men\", \"q\": " + numbers + "}"}) {
    const fit::PoseVector q = read_initial_pose(folder.put("q.json", text));
    EXPECT_EQ(q[0], 0.5);
    EXPECT_EQ(q[35], 35);
  }
  for (const char* text : {"", "[1,2", "[1,2]", "{\"q\": 3}", "\"q\""})
    EXPECT_THAT(message_of([&] { read_initial_pose(folder.put("q.json", text)); }), HasSubstr("q.json")) << text;
  std::string word = numbers;
  word.replace(1, 3, "\"x\"");
  EXPECT_THAT(message_of([&] { read_initial_pose(folder.put("q.json", word)); }), HasSubstr("q[0] (root_tx)"));
  std::string huge = numbers;
  huge.replace(1, 3, "1e9");
  EXPECT_THAT(message_of([&] { read_initial_pose(folder.put("q.json", huge)); }), HasSubstr("q[0]"));
}

}  // namespace
}  // namespace booth::daemon
