// A binary buffer of typed accessors and the JSON that describes it, as the glTF 2.0 specification lays them out.
#include "daemon/io/glb_file.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of the specification.
enum Component : int { kUnsignedByte = 5121, kUnsignedInt = 5125, kFloat = 5126 };
enum Target : int { kNoTarget = 0, kArrayBuffer = 34962, kElementBuffer = 34963 };

/// Collects accessors; every one begins on a multiple of four bytes.
class Buffer {
 public:
  template <typename T>
  int add(const std::vector<T>& values, const char* type, std::size_t per_element, Component component, Target target) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    Json view{{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", values.size() * sizeof(T)}};
    if (target != kNoTarget) view["target"] = static_cast<int>(target);
    views_.push_back(view);
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    accessors_.push_back(
        {{"bufferView", views_.size() - 1}, {"componentType", static_cast<int>(component)}, {"count", values.size() / per_element}, {"type", type}});
    return static_cast<int>(accessors_.size()) - 1;
  }
  Json& accessor(int i) { return accessors_[static_cast<std::size_t>(i)]; }
  const std::string& bytes() const { return bytes_; }
  const Json& views() const { return views_; }
  const Json& accessors() const { return accessors_; }

 private:
  std::string bytes_;
  Json views_ = Json::array(), accessors_ = Json::array();
};

std::vector<float> flat(const Eigen::Matrix3Xf& m) { return {m.data(), m.data() + m.size()}; }

std::array<float, 4> quaternion(const Eigen::Matrix3d& r) {
  const Eigen::Quaternionf q(r.cast<float>());
  const Eigen::Quaternionf n = q.normalized();
  return {n.x(), n.y(), n.z(), n.w()};
}

/// Rotation of every bone relative to its parent.
std::array<Eigen::Matrix3d, fit::kBones> local_rotations(const fit::Kinematics& k) {
  std::array<Eigen::Matrix3d, fit::kBones> local;
  local[0] = k.rotation[0];
  for (std::size_t b = 1; b < fit::kBones; ++b) local[b] = k.rotation[static_cast<std::size_t>(fit::bones()[b].parent)].transpose() * k.rotation[b];
  return local;
}

/// Nodes 0..23 are the bones; behind them come the loose ends, then the mesh. Returns the index of the mesh's node.
std::size_t append_nodes(Json& nodes, const fit::Points3& bone_vectors, const fit::PoseVector& pose) {
  fit::Kinematics kinematics;
  fit::forward_kinematics(pose, bone_vectors, kinematics);
  const auto local = local_rotations(kinematics);
  const auto bones = fit::bones();
  std::array<std::vector<std::size_t>, fit::kBones> children;
  for (std::size_t b = 1; b < fit::kBones; ++b) children[static_cast<std::size_t>(bones[b].parent)].push_back(b);
  std::size_t next = fit::kBones;
  std::vector<Json> ends;
  for (std::size_t b = 0; b < fit::kBones; ++b) {
    const Eigen::Vector3d at = b == 0 ? Eigen::Vector3d(pose.head<3>()) : Eigen::Vector3d(bone_vectors.col(bones[b].parent));
    if (children[b].empty()) {
      const Eigen::Vector3d end = bone_vectors.col(static_cast<Eigen::Index>(b));
      ends.push_back({{"name", bones[b].end_joint}, {"translation", {end.x(), end.y(), end.z()}}});
      children[b].push_back(next++);
    }
    nodes.push_back({{"name", bones[b].name}, {"translation", {at.x(), at.y(), at.z()}}, {"rotation", quaternion(local[b])}, {"children", children[b]}});
  }
  for (Json& e : ends) nodes.push_back(std::move(e));
  nodes.push_back({{"name", "body"}, {"mesh", 0}, {"skin", 0}});
  return next;
}

int add_inverse_bind_matrices(Buffer& buffer, const GlbBody& body) {
  std::vector<float> matrices;
  for (int b = 0; b < fit::kBones; ++b) {
    Eigen::Matrix4f m = Eigen::Matrix4f::Identity();
    const Eigen::Matrix3d to_bone = body.model.rest_rotation(b).transpose();
    m.topLeftCorner<3, 3>() = to_bone.cast<float>();
    m.topRightCorner<3, 1>() = (-(to_bone * body.rest_joints.col(fit::start_joint(b)))).cast<float>();
    matrices.insert(matrices.end(), m.data(), m.data() + m.size());  // column-major in Eigen and in glTF
  }
  return buffer.add(matrices, "MAT4", 16, kFloat, kNoTarget);
}

Json mesh_primitive(Buffer& buffer, const GlbBody& body) {
  const fit::BodyModelData& data = body.model.data();
  fit::Vertices normals;
  fit::vertex_normals(body.rest_vertices, data.faces, normals);
  // Validators want unit normals even where a vertex belongs to no face.
  for (Eigen::Index v = 0; v < normals.cols(); ++v)
    if (normals.col(v).isZero()) normals.col(v) = Eigen::Vector3f::UnitY();
  const int position = buffer.add(flat(body.rest_vertices), "VEC3", 3, kFloat, kArrayBuffer);
  const Eigen::Vector3f low = body.rest_vertices.rowwise().minCoeff(), high = body.rest_vertices.rowwise().maxCoeff();
  buffer.accessor(position)["min"] = {low.x(), low.y(), low.z()};
  buffer.accessor(position)["max"] = {high.x(), high.y(), high.z()};
  const int normal = buffer.add(flat(normals), "VEC3", 3, kFloat, kArrayBuffer);
  std::vector<std::uint8_t> joints(static_cast<std::size_t>(data.skin_bone.size()));
  for (Eigen::Index i = 0; i < data.skin_bone.size(); ++i)  // an unused entry names joint 0, as the specification asks
    joints[static_cast<std::size_t>(i)] = data.skin_weight.data()[i] > 0 ? data.skin_bone.data()[i] : std::uint8_t{0};
  static_assert(fit::kSkinBones == 4, "glTF moves a vertex with four joints");
  const int joint = buffer.add(joints, "VEC4", 4, kUnsignedByte, kArrayBuffer);
  const int weight =
      buffer.add(std::vector<float>(data.skin_weight.data(), data.skin_weight.data() + data.skin_weight.size()), "VEC4", 4, kFloat, kArrayBuffer);
  const int index = buffer.add(std::vector<std::uint32_t>(data.faces.data(), data.faces.data() + data.faces.size()), "SCALAR", 1, kUnsignedInt, kElementBuffer);
  return {{"attributes", {{"POSITION", position}, {"NORMAL", normal}, {"JOINTS_0", joint}, {"WEIGHTS_0", weight}}}, {"indices", index}, {"material", 0}};
}

Json animation(Buffer& buffer, const GlbBody& body, const fit::Points3& bone_vectors) {
  const std::size_t frames = body.motion.size();
  std::vector<float> times(frames), root(3 * frames);
  std::array<std::vector<float>, fit::kBones> rotations;
  fit::Kinematics kinematics;
  for (std::size_t i = 0; i < frames; ++i) {
    times[i] = static_cast<float>(static_cast<double>(i) * body.frame_seconds);
    for (std::size_t k = 0; k < 3; ++k) root[3 * i + k] = static_cast<float>(body.motion[i][static_cast<Eigen::Index>(k)]);
    fit::forward_kinematics(body.motion[i], bone_vectors, kinematics);
    const auto local = local_rotations(kinematics);
    for (std::size_t b = 0; b < fit::kBones; ++b) {
      const auto q = quaternion(local[b]);
      rotations[b].insert(rotations[b].end(), q.begin(), q.end());
    }
  }
  const int input = buffer.add(times, "SCALAR", 1, kFloat, kNoTarget);
  buffer.accessor(input)["min"] = {times.front()};
  buffer.accessor(input)["max"] = {times.back()};
  Json samplers = Json::array(), channels = Json::array();
  const auto channel = [&](std::size_t node, const char* path, int output) {
    channels.push_back({{"sampler", samplers.size()}, {"target", {{"node", node}, {"path", path}}}});
    samplers.push_back({{"input", input}, {"output", output}, {"interpolation", "LINEAR"}});
  };
  channel(0, "translation", buffer.add(root, "VEC3", 3, kFloat, kNoTarget));
  for (std::size_t b = 0; b < fit::kBones; ++b) {
    const auto& dof = fit::bones()[b].dof;
    if (dof[0] < 0 && dof[1] < 0 && dof[2] < 0) continue;  // turns with its parent
    channel(b, "rotation", buffer.add(rotations[b], "VEC4", 4, kFloat, kNoTarget));
  }
  return {{"name", "motion"}, {"samplers", samplers}, {"channels", channels}};
}

void append_word(std::string& out, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  char raw[4];
  std::memcpy(raw, &word, 4);
  out.append(raw, 4);
}

}  // namespace

void write_glb(const FileTarget& target, const GlbBody& body) {
  if (body.rest_vertices.cols() != body.model.vertex_count()) throw std::invalid_argument("write_glb: the body's vertices are not the model's in number");
  if (!body.rest_vertices.allFinite() || !body.rest_joints.allFinite() || !body.pose.allFinite())
    throw std::invalid_argument("write_glb: a value is not finite");
  if (!body.motion.empty() && !(body.frame_seconds > 0)) throw std::invalid_argument("write_glb: the time between frames must be positive");
  const fit::Points3 bone_vectors = body.model.bone_vectors_from_joints(body.rest_joints);

  Buffer buffer;
  Json nodes = Json::array();
  const std::size_t mesh_node = append_nodes(nodes, bone_vectors, body.pose);
  std::vector<int> skin_joints(fit::kBones);
  for (int b = 0; b < fit::kBones; ++b) skin_joints[static_cast<std::size_t>(b)] = b;

  Json document;
  document["asset"] = {{"version", "2.0"}, {"generator", "boothd"}};
  document["scene"] = 0;
  document["scenes"] = Json::array({Json{{"nodes", {std::size_t{0}, mesh_node}}}});
  document["nodes"] = std::move(nodes);
  document["materials"] = Json::array();
  document["materials"].push_back(
      {{"name", "body"}, {"pbrMetallicRoughness", {{"baseColorFactor", {0.72, 0.70, 0.68, 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.8}}}});
  document["meshes"] = Json::array();
  document["meshes"].push_back({{"name", "body"}, {"primitives", Json::array({mesh_primitive(buffer, body)})}});
  document["skins"] = Json::array();
  document["skins"].push_back(
      {{"name", "skeleton"}, {"inverseBindMatrices", add_inverse_bind_matrices(buffer, body)}, {"skeleton", 0}, {"joints", skin_joints}});
  if (!body.motion.empty()) document["animations"] = Json::array({animation(buffer, body, bone_vectors)});
  document["bufferViews"] = buffer.views();
  document["accessors"] = buffer.accessors();
  document["buffers"] = Json::array();
  document["buffers"].push_back({{"byteLength", buffer.bytes().size()}});

  std::string json = document.dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string binary = buffer.bytes();
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  std::string out;
  out.reserve(28 + json.size() + binary.size());
  out += "glTF";
  append_word(out, 2);
  append_word(out, 28 + json.size() + binary.size());
  append_word(out, json.size());
  out += "JSON";
  out += json;
  append_word(out, binary.size());
  out.append("BIN\0", 4);
  out += binary;
  write_file_atomically(target, out);
}

}  // namespace booth::daemon
