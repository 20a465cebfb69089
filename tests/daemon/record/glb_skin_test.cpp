// body.glb moved by a stranger: assimp reads skin, skeleton and animation, and its vertices at each frame are those of our model in that pose.
#include <assimp/anim.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <assimp/Importer.hpp>
#include <map>
#include <optional>

#include "daemon/io/model_file.hpp"
#include "daemon/record/session_export.hpp"
#include "tests/daemon/record/session_samples.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

constexpr double kMost = 2e-5;  ///< metres: 32-bit floats of a body of two metres, products of eight of them

/// Linear blend skinning as the glTF specification has it, from what assimp hands out; nothing of ours takes part.
class Skinned {
 public:
  explicit Skinned(const std::string& file) : scene_(importer_.ReadFile(file, 0)) {
    if (!scene_ || scene_->mNumMeshes != 1 || scene_->mNumAnimations != 1) throw std::runtime_error(importer_.GetErrorString());
  }
  /// At a key of the animation; without one, as the nodes stand.
  fit::Vertices vertices(std::optional<unsigned> key) const {
    std::map<std::string, aiMatrix4x4> global;
    walk(*scene_->mRootNode, {}, key, global);
    const aiMesh& mesh = *scene_->mMeshes[0];
    fit::Vertices out = fit::Vertices::Zero(3, mesh.mNumVertices);
    for (unsigned b = 0; b < mesh.mNumBones; ++b) {
      const aiBone& bone = *mesh.mBones[b];
      const aiMatrix4x4 m = global.at(bone.mName.C_Str()) * bone.mOffsetMatrix;
      for (unsigned w = 0; w < bone.mNumWeights; ++w) {
        const aiVector3D p = m * mesh.mVertices[bone.mWeights[w].mVertexId];
        out.col(bone.mWeights[w].mVertexId) += bone.mWeights[w].mWeight * Eigen::Vector3f(p.x, p.y, p.z);
      }
    }
    return out;
  }
  fit::Vertices bind_pose() const {
    const aiMesh& mesh = *scene_->mMeshes[0];
    fit::Vertices out(3, mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) out.col(v) << mesh.mVertices[v].x, mesh.mVertices[v].y, mesh.mVertices[v].z;
    return out;
  }
  unsigned keys() const {
    unsigned out = 0;
    for (unsigned c = 0; c < scene_->mAnimations[0]->mNumChannels; ++c) out = std::max(out, scene_->mAnimations[0]->mChannels[c]->mNumRotationKeys);
    return out;
  }

 private:
  aiMatrix4x4 local(const aiNode& node, std::optional<unsigned> key) const {
    if (!key) return node.mTransformation;
    const aiAnimation& animation = *scene_->mAnimations[0];
    for (unsigned c = 0; c < animation.mNumChannels; ++c) {
      const aiNodeAnim& channel = *animation.mChannels[c];
      if (channel.mNodeName != node.mName) continue;
      // A channel without keys of one kind holds the node's own value as its only key.
      const aiVector3D at = channel.mPositionKeys[std::min(*key, channel.mNumPositionKeys - 1)].mValue;
      const aiQuaternion turn = channel.mRotationKeys[std::min(*key, channel.mNumRotationKeys - 1)].mValue;
      return aiMatrix4x4(aiVector3D(1, 1, 1), turn, at);
    }
    return node.mTransformation;
  }
  void walk(const aiNode& node, const aiMatrix4x4& parent, std::optional<unsigned> key, std::map<std::string, aiMatrix4x4>& global) const {
    const aiMatrix4x4 here = parent * local(node, key);
    global[node.mName.C_Str()] = here;
    for (unsigned i = 0; i < node.mNumChildren; ++i) walk(*node.mChildren[i], here, key, global);
  }

  Assimp::Importer importer_;
  const aiScene* scene_;
};

double farthest(const fit::Vertices& a, const fit::Vertices& b) { return static_cast<double>((a - b).colwise().norm().maxCoeff()); }

TEST(GlbSkin, EveryVertexOfTheRealModelMovesAsOurs) {
  const fit::BodyModel model = load_body_model(find_models("") / "men.npz");
  const tests::TemporaryFolder folder;
  const std::vector<FrameRecord> frames = tests::sample_frames(40);
  const FrameRecord& last = frames.back();
  export_glb(folder.path / "body.glb", frames, last, model);
  const Skinned read((folder.path / "body.glb").string());
  ASSERT_GE(read.keys(), frames.size() - 1) << "at an even 30 frames/s; the frames lie a third of a nanosecond closer";

  const fit::ShapeVector beta = Eigen::Map<const Eigen::VectorXd>(last.beta.data(), last.shape_count);
  fit::Vertices expected;
  model.shaped(beta, expected);
  EXPECT_LT(farthest(read.bind_pose(), expected), kMost) << "the body in its A-pose";
  model.posed(beta, Eigen::Map<const fit::PoseVector>(last.q.data()), expected);
  EXPECT_LT(farthest(read.vertices(std::nullopt), expected), kMost) << "as the nodes stand: the fitted pose";
  double worst = 0;
  for (const unsigned k : {0u, 1u, 13u, 26u, 38u}) {
    model.posed(beta, Eigen::Map<const fit::PoseVector>(frames[k].q.data()), expected);
    const double far = farthest(read.vertices(k), expected);
    EXPECT_LT(far, kMost) << "frame " << k;
    worst = std::max(worst, far);
  }
  RecordProperty("worst_mm", std::to_string(1e3 * worst));
  // The comparison sees what it should see: the frame beside it is another pose.
  model.posed(beta, Eigen::Map<const fit::PoseVector>(frames[14].q.data()), expected);
  EXPECT_GT(farthest(read.vertices(13), expected), 1e-3);
}

}  // namespace
}  // namespace booth::daemon
