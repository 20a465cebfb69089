// What write_ply() wrote, read back by our reader and by assimp.
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>

#include <assimp/Importer.hpp>

#include "daemon/io/mesh_file.hpp"
#include "fit/body/body_model.hpp"
#include "tests/daemon/io/scratch_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {
namespace {

using tests::ScratchFolder;

struct Body {
  fit::Vertices vertices, normals;
  fit::Faces faces;
  Eigen::Matrix<std::uint8_t, 3, Eigen::Dynamic> colours;
};

Body body() {
  const auto model = tests::capsule_body();
  Body b{{}, {}, model->data().faces, {}};
  model->shaped(fit::ShapeVector(), b.vertices);
  fit::vertex_normals(b.vertices, b.faces, b.normals);
  b.colours.resize(3, b.vertices.cols());
  for (Eigen::Index i = 0; i < b.vertices.cols(); ++i) b.colours.col(i) << static_cast<std::uint8_t>(i), 100, 200;
  return b;
}

TEST(WritePly, ReadsBackTheSameBitsInEitherFrame) {
  ScratchFolder folder;
  const Body b = body();
  for (const UpAxis up : {UpAxis::z, UpAxis::y}) {
    write_ply(folder / "b.ply", {b.vertices, &b.normals, &b.faces, &b.colours}, up, "a test");
    const CloudFile c = read_cloud_file(folder / "b.ply", {.units = Units::metres, .up = up});
    EXPECT_EQ(c.points, b.vertices);
    EXPECT_EQ(c.faces, b.faces);
    EXPECT_TRUE(c.normals.isApprox(b.normals, 1e-6f));
  }
}

TEST(WritePly, StandsUprightInTheBoothFrame) {
  ScratchFolder folder;
  const Body b = body();
  write_ply(folder / "b.ply", {b.vertices});
  const CloudFile as_it_stands = read_cloud_file(folder / "b.ply", {.units = Units::metres, .up = UpAxis::y});  // no turning
  const Eigen::Vector3f extent = as_it_stands.points.rowwise().maxCoeff() - as_it_stands.points.rowwise().minCoeff();
  EXPECT_GT(extent.z(), 1.4f) << "the height is along z";
  EXPECT_GT(extent.y(), extent.x()) << "the arms reach out along y";
}

TEST(WritePly, AnotherReaderAgrees) {
  ScratchFolder folder;
  const Body b = body();
  write_ply(folder / "b.ply", {b.vertices, &b.normals, &b.faces, &b.colours}, UpAxis::y);
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "b.ply").string(), aiProcess_ValidateDataStructure);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  ASSERT_EQ(scene->mNumMeshes, 1u);
  const aiMesh& mesh = *scene->mMeshes[0];
  ASSERT_EQ(mesh.mNumVertices, static_cast<unsigned>(b.vertices.cols()));
  ASSERT_EQ(mesh.mNumFaces, static_cast<unsigned>(b.faces.cols()));
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    EXPECT_EQ(mesh.mVertices[i].x, b.vertices(0, i));
    EXPECT_EQ(mesh.mNormals[i].y, b.normals(1, i));
    EXPECT_NEAR(mesh.mColors[0][i].r, b.colours(0, i) / 255.0, 1e-6);
  }
}

TEST(WritePly, RefusesSizesThatDoNotAgree) {
  ScratchFolder folder;
  const Body b = body();
  const Eigen::Matrix3Xf two(3, 2);
  EXPECT_THROW(write_ply(folder / "b.ply", {b.vertices, &two}), std::invalid_argument);
  EXPECT_THROW(write_ply(folder / "b.ply", {b.vertices}, UpAxis::z, "two\nlines"), std::invalid_argument);
  EXPECT_EQ(folder.entries(), 0u);
}

}  // namespace
}  // namespace booth::daemon
