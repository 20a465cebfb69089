// The rig's bones are mapped onto ours, carried over by the template's rows, smoothed over the surface, made symmetric and cut to four.
#include "fit/train/skinning.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

namespace booth::fit::train {
namespace {

/// Rig bones by the beginning of their name -> our bone; a second one shares the weight where two of ours meet.
struct Rule {
  std::string_view prefix, bone, second;
  double part = 1;  // of the first
};
constexpr std::array<Rule, 21> kRules{{
    {"pelvis", "root", ""},
    {"root", "root", ""},
    {"spine05", "root", ""},
    {"spine04", "root", "upperback", 0.65},
    {"spine03", "root", "upperback", 0.25},
    {"spine0", "upperback", ""},
    {"breast", "upperback", ""},
    {"clavicle", "*clavicle", ""},
    {"shoulder01", "*clavicle", ""},
    {"upperarm", "*humerus", ""},
    {"lowerarm", "*radius", ""},
    {"wrist", "*radius", ""},
    {"metacarpal", "*radius", ""},
    {"finger", "*radius", ""},
    {"upperleg", "*femur", ""},
    {"lowerleg", "*tibia", ""},
    {"foot", "*foot", ""},
    {"toe", "*foot", ""},
    {"neck03", "neck", "head", 0.5},
    {"neck0", "neck", ""},
    {"", "head", ""},  // jaw, lips, lids, tongue
}};

int our_bone(std::string_view pattern, bool left) {
  if (!pattern.starts_with('*')) return bone_index(pattern);
  std::string name(pattern);
  name[0] = left ? 'l' : 'r';
  return bone_index(name);
}

constexpr int kSmoothingSteps = 3;
constexpr double kLeastWeight = 0.005;

}  // namespace

void transfer_skinning(const BaseBody& base, const TemplateMesh& mesh, BodyModelData& model) {
  const Eigen::Index count = mesh.vertex_count();
  Eigen::MatrixXd on_base = Eigen::MatrixXd::Zero(kBones, base.skin_vertices);
  for (const auto& [name, entries] : base.weights) {
    const Rule& rule = *std::find_if(kRules.begin(), kRules.end(), [&group = name](const Rule& r) { return group.starts_with(r.prefix); });
    const bool left = name.ends_with(".L");
    for (const auto& [v, w] : entries) {
      if (v >= base.skin_vertices) continue;
      on_base(our_bone(rule.bone, left), v) += rule.part * w;
      if (!rule.second.empty()) on_base(our_bone(rule.second, left), v) += (1 - rule.part) * w;
    }
  }
  for (Eigen::Index v = 0; v < on_base.cols(); ++v) {
    const double sum = on_base.col(v).sum();
    if (sum > 0)
      on_base.col(v) /= sum;
    else
      on_base(0, v) = 1;
  }

  Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(kBones, count);
  for (Eigen::Index v = 0; v < count; ++v)
    for (const auto& [i, w] : mesh.rows[static_cast<std::size_t>(v)]) weight.col(v) += static_cast<double>(w) * on_base.col(i);

  // Half of each vertex's weights from its neighbours' mean, a few times over.
  for (int step = 0; step < kSmoothingSteps; ++step) {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(kBones, count);
    Eigen::VectorXd uses = Eigen::VectorXd::Zero(count);
    for (Eigen::Index f = 0; f < model.faces.cols(); ++f)
      for (int i = 0; i < 3; ++i)
        for (int j : {(i + 1) % 3, (i + 2) % 3}) {
          sum.col(model.faces(i, f)) += weight.col(model.faces(j, f));
          uses[model.faces(i, f)] += 1;
        }
    for (Eigen::Index v = 0; v < count; ++v) weight.col(v) = 0.5 * weight.col(v) + 0.5 * sum.col(v) / uses[v];
  }

  Eigen::MatrixXd symmetric(kBones, count);
  for (Eigen::Index v = 0; v < count; ++v)
    for (int b = 0; b < kBones; ++b) symmetric(b, v) = (weight(b, v) + weight(mirror_bone(b), model.mirror_vertex[v])) / 2;

  model.skin_bone.setZero(kSkinBones, count);
  model.skin_weight.setZero(kSkinBones, count);
  for (Eigen::Index v = 0; v < count; ++v) {
    std::array<int, kBones> order;
    std::iota(order.begin(), order.end(), 0);
    // Ties are broken towards the middle and then by the mirrored order, so that both sides choose alike.
    const bool right = model.mirror_vertex[v] < v;
    const auto rank = [&](int b) { return right ? mirror_bone(b) : b; };
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return symmetric(a, v) != symmetric(b, v) ? symmetric(a, v) > symmetric(b, v) : rank(a) < rank(b); });
    std::vector<int> chosen;
    for (int i = 0; i < kSkinBones; ++i)
      if (const int b = order[static_cast<std::size_t>(i)]; symmetric(b, v) > kLeastWeight) chosen.push_back(b);
    // On the midline a bone stays only together with its counterpart.
    if (model.mirror_vertex[v] == v) std::erase_if(chosen, [all = chosen](int b) { return std::find(all.begin(), all.end(), mirror_bone(b)) == all.end(); });
    double sum = 0;
    for (int b : chosen) sum += symmetric(b, v);
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      model.skin_bone(static_cast<Eigen::Index>(i), v) = static_cast<std::uint8_t>(chosen[i]);
      model.skin_weight(static_cast<Eigen::Index>(i), v) = static_cast<float>(symmetric(chosen[i], v) / sum);
    }
  }
}

}  // namespace booth::fit::train
