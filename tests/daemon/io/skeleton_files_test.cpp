// BVH, glTF and CSV say the same as forward kinematics and skinning do, according to an independent reader (assimp).
#include <assimp/anim.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <assimp/Importer.hpp>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "daemon/io/bvh_file.hpp"
#include "daemon/io/csv_file.hpp"
#include "daemon/io/glb_file.hpp"
#include "tests/daemon/io/scratch_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {
namespace {

using tests::ScratchFolder;

/// A walk through pose space in which every degree of freedom moves; two full turns of the heading, so that wrapping would show.
std::vector<fit::PoseVector> motion(std::size_t frames) {
  std::vector<fit::PoseVector> poses(frames);
  for (std::size_t i = 0; i < frames; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(frames);
    for (int d = 0; d < fit::kDofs; ++d) poses[i][d] = 0.7 * std::sin(6.3 * t + d) + (d == 4 ? 12.6 * t : 0);
  }
  return poses;
}

/// World transforms of all nodes at a frame of the first animation, or as the file stands when frame < 0.
class World {
 public:
  World(const aiScene& scene, int frame) {
    if (frame >= 0)
      for (unsigned c = 0; c < scene.mAnimations[0]->mNumChannels; ++c) {
        const aiNodeAnim& channel = *scene.mAnimations[0]->mChannels[c];
        channels_[channel.mNodeName.C_Str()] = &channel;
      }
    visit(*scene.mRootNode, aiMatrix4x4(), static_cast<unsigned>(std::max(frame, 0)));
  }
  Eigen::Matrix4d at(const std::string& name) const {
    const aiMatrix4x4& m = nodes_.at(name);
    return Eigen::Map<const Eigen::Matrix<ai_real, 4, 4, Eigen::RowMajor>>(&m.a1).cast<double>();
  }
  Eigen::Vector3d place(const std::string& name) const { return at(name).topRightCorner<3, 1>(); }

 private:
  void visit(const aiNode& node, const aiMatrix4x4& parent, unsigned frame) {
    aiMatrix4x4 local = node.mTransformation;
    if (const auto it = channels_.find(node.mName.C_Str()); it != channels_.end()) {
      const aiNodeAnim& c = *it->second;
      local = aiMatrix4x4(aiVector3D(1, 1, 1), c.mRotationKeys[std::min(frame, c.mNumRotationKeys - 1)].mValue,
                          c.mPositionKeys[std::min(frame, c.mNumPositionKeys - 1)].mValue);
    }
    const aiMatrix4x4 global = parent * local;
    nodes_[node.mName.C_Str()] = global;
    for (unsigned i = 0; i < node.mNumChildren; ++i) visit(*node.mChildren[i], global, frame);
  }
  std::map<std::string, const aiNodeAnim*> channels_;
  std::map<std::string, aiMatrix4x4> nodes_;
};

/// Where a node of ours stands: at the start of its bone.
void expect_joints(const World& world, const fit::PoseVector& q, const fit::Points3& vectors, double tolerance) {
  fit::Kinematics k;
  fit::forward_kinematics(q, vectors, k);
  for (int b = 0; b < fit::kBones; ++b) {
    const fit::Bone& bone = fit::bones()[static_cast<std::size_t>(b)];
    const Eigen::Vector3d start = k.joint.col(fit::start_joint(b));
    EXPECT_LT((world.place(std::string(bone.name)) - start).norm(), tolerance) << bone.name;
    EXPECT_LT((world.at(std::string(bone.name)).topLeftCorner<3, 3>() - k.rotation[static_cast<std::size_t>(b)]).norm(), 10 * tolerance) << bone.name;
  }
}

TEST(Bvh, AnIndependentReaderFindsTheSameJoints) {
  ScratchFolder folder;
  const auto poses = motion(25);
  const fit::Points3& vectors = fit::average_bone_vectors();
  write_bvh(folder / "m.bvh", vectors, poses, 1.0 / 30);
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "m.bvh").string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  ASSERT_EQ(scene->mNumAnimations, 1u);
  EXPECT_NEAR(scene->mAnimations[0]->mTicksPerSecond, 30, 1e-3);
  for (std::size_t i = 0; i < poses.size(); ++i) expect_joints(World(*scene, static_cast<int>(i)), poses[i], vectors, 2e-5);
  // A bone without children ends in an End Site.
  fit::Kinematics k;
  fit::forward_kinematics(poses[3], vectors, k);
  EXPECT_LT((World(*scene, 3).place("EndSite_head") - k.joint.col(fit::joint_index("head_top"))).norm(), 2e-5);
}

TEST(Bvh, AnglesNeverJumpBetweenFrames) {
  const auto poses = motion(200);
  const std::string text = bvh_text(fit::average_bone_vectors(), poses, 1.0 / 30);
  std::istringstream in(text.substr(text.find("Frame Time")));
  std::string line;
  std::getline(in, line);
  std::vector<double> before;
  int rows = 0;
  while (std::getline(in, line)) {
    std::istringstream numbers(line);
    const std::vector<double> now{std::istream_iterator<double>(numbers), {}};
    ASSERT_EQ(now.size(), 3u + 3u * fit::kBones);
    for (std::size_t i = 0; i < before.size(); ++i) EXPECT_LT(std::abs(now[i] - before[i]), 60) << "row " << rows << " channel " << i;
    before = now;
    ++rows;
  }
  EXPECT_EQ(rows, 200);
}

TEST(Bvh, SurvivesAnglesWhereZAndXTurnAboutTheSameAxis) {
  ScratchFolder folder;
  fit::PoseVector q = fit::PoseVector::Zero();
  q[fit::dof_index("root_ry")] = 1.5707963267948966;
  q[fit::dof_index("root_rx")] = 0.4;
  write_bvh(folder / "m.bvh", fit::average_bone_vectors(), std::vector<fit::PoseVector>{q}, 0.1);
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "m.bvh").string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  expect_joints(World(*scene, 0), q, fit::average_bone_vectors(), 2e-5);
  EXPECT_THROW(bvh_text(fit::average_bone_vectors(), {}, 0), std::invalid_argument);
}

struct Individual {
  std::shared_ptr<const fit::BodyModel> model = tests::capsule_body();
  fit::ShapeVector beta;
  fit::Vertices rest;
  fit::Points3 joints;
  Individual() {
    beta.resize(3);
    beta << 0.7, -1.2, 0.4;
    model->shaped(beta, rest);
    joints = model->rest_joints(beta);
  }
};

/// Skinning by the rules of glTF, with assimp's bones.
Eigen::Matrix3Xd skinned(const aiScene& scene, const World& world) {
  const aiMesh& mesh = *scene.mMeshes[0];
  Eigen::Matrix3Xd out = Eigen::Matrix3Xd::Zero(3, mesh.mNumVertices);
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const Eigen::Matrix4d offset = Eigen::Map<const Eigen::Matrix<ai_real, 4, 4, Eigen::RowMajor>>(&bone.mOffsetMatrix.a1).cast<double>();
    const Eigen::Matrix4d m = world.at(bone.mName.C_Str()) * offset;
    for (unsigned w = 0; w < bone.mNumWeights; ++w) {
      const aiVector3D& p = mesh.mVertices[bone.mWeights[w].mVertexId];
      out.col(bone.mWeights[w].mVertexId) += bone.mWeights[w].mWeight * (m * Eigen::Vector4d(p.x, p.y, p.z, 1)).head<3>();
    }
  }
  return out;
}

TEST(Glb, AnIndependentReaderSkinsTheSameBody) {
  ScratchFolder folder;
  const Individual who;
  const auto poses = motion(6);
  const fit::PoseVector still = motion(7)[5];
  write_glb(folder / "b.glb", {*who.model, who.rest, who.joints, still, poses, 0.04});
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "b.glb").string(), aiProcess_ValidateDataStructure);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  ASSERT_EQ(scene->mNumMeshes, 1u);
  ASSERT_EQ(scene->mNumAnimations, 1u);
  ASSERT_EQ(scene->mMeshes[0]->mNumVertices, static_cast<unsigned>(who.model->vertex_count()));
  EXPECT_EQ(scene->mMeshes[0]->mNumFaces, static_cast<unsigned>(who.model->data().faces.cols()));
  const fit::Points3 vectors = who.model->bone_vectors(who.beta);
  for (int frame = -1; frame < static_cast<int>(poses.size()); ++frame) {
    const fit::PoseVector& q = frame < 0 ? still : poses[static_cast<std::size_t>(frame)];
    const World world(*scene, frame);
    expect_joints(world, q, vectors, 1e-5);
    fit::Vertices expected;
    who.model->posed(who.beta, q, expected);
    EXPECT_LT((skinned(*scene, world) - expected.cast<double>()).colwise().norm().maxCoeff(), 2e-5) << "frame " << frame;
  }
  fit::Kinematics k;
  fit::forward_kinematics(still, vectors, k);
  EXPECT_LT((World(*scene, -1).place("lhand_end") - k.joint.col(fit::joint_index("lhand_end"))).norm(), 1e-5);
}

TEST(Glb, ObeysTheContainersRules) {
  ScratchFolder folder;
  const Individual who;
  write_glb(folder / "b.glb", {*who.model, who.rest, who.joints, who.model->rest_pose()});
  const std::string bytes = ScratchFolder::get(folder / "b.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t w;
    std::memcpy(&w, bytes.data() + at, 4);
    return w;
  };
  ASSERT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(word(12) % 4, 0u);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  const auto json = nlohmann::json::parse(bytes.substr(20, word(12)));
  const std::size_t binary = 20 + word(12);
  EXPECT_EQ(bytes.substr(binary + 4, 4), std::string("BIN\0", 4));
  EXPECT_EQ(binary + 8 + word(binary), bytes.size());
  EXPECT_FALSE(json.contains("animations"));
  EXPECT_EQ(json["skins"][0]["joints"].size(), 24u);
  EXPECT_EQ(json["scenes"][0]["nodes"].size(), 2u) << "the skeleton's root and the body";
  static const std::map<std::string, int> values{{"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
  for (const auto& a : json["accessors"]) {
    const auto& view = json["bufferViews"][a["bufferView"].get<std::size_t>()];
    const int width = a["componentType"] == 5121 ? 1 : 4;
    EXPECT_EQ(view["byteOffset"].get<int>() % 4, 0);
    EXPECT_EQ(view["byteLength"].get<int>(), a["count"].get<int>() * values.at(a["type"]) * width);
    EXPECT_LE(view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>(), word(binary));
  }
}

TEST(Glb, RefusesSizesThatDoNotAgreeAndValuesThatAreNoNumbers) {
  ScratchFolder folder;
  const Individual who;
  const fit::Vertices few = who.rest.leftCols(5);
  fit::Vertices broken = who.rest;
  broken(1, 7) = std::nanf("");
  EXPECT_THROW(write_glb(folder / "b.glb", {*who.model, few, who.joints, who.model->rest_pose()}), std::invalid_argument);
  EXPECT_THROW(write_glb(folder / "b.glb", {*who.model, broken, who.joints, who.model->rest_pose()}), std::invalid_argument);
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(SkeletonCsv, NamesUnitsAndReadsBackTheSameNumbersInTheBoothFrame) {
  ScratchFolder folder;
  SkeletonRow row;
  row.time = 1.25;
  row.utc_ns = 1700000000123456789;
  row.state = "tracked";
  row.residual = 0.0071;
  row.q = motion(3)[1];
  fit::Kinematics k;
  fit::forward_kinematics(row.q, fit::average_bone_vectors(), k);
  row.joints = k.joint;
  write_skeleton_csv(folder / "s.csv", std::vector<SkeletonRow>{row, row});

  std::istringstream in(ScratchFolder::get(folder / "s.csv"));
  const auto split = [](const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    return cells;
  };
  std::string line;
  std::getline(in, line);
  const auto names = split(line);
  std::getline(in, line);
  const auto cells = split(line);
  ASSERT_EQ(names.size(), 4u + fit::kDofs + 3u * fit::kJoints);
  ASSERT_EQ(cells.size(), names.size());
  const auto cell = [&](const std::string& name) {
    const auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end()) throw std::runtime_error("no column " + name);
    return cells[static_cast<std::size_t>(it - names.begin())];
  };
  EXPECT_EQ(cell("time_s"), "1.250000");
  EXPECT_EQ(cell("utc_ns"), "1700000000123456789");
  EXPECT_EQ(cell("state"), "tracked");
  EXPECT_EQ(std::stof(cell("root_ty_m")), static_cast<float>(row.q[1]));
  EXPECT_EQ(std::stof(cell("lfemur_rx_rad")), static_cast<float>(row.q[fit::dof_index("lfemur_rx")]));
  const Eigen::Vector3d wrist = row.joints.col(fit::joint_index("lwrist"));
  EXPECT_EQ(std::stof(cell("lwrist_x_m")), static_cast<float>(wrist.z()));
  EXPECT_EQ(std::stof(cell("lwrist_y_m")), static_cast<float>(wrist.x()));
  EXPECT_EQ(std::stof(cell("lwrist_z_m")), static_cast<float>(wrist.y()));
  std::getline(in, line);
  EXPECT_EQ(split(line), cells);
  EXPECT_FALSE(std::getline(in, line));
}

}  // namespace
}  // namespace booth::daemon
