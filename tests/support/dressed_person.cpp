// A posed template is subdivided once and pushed out along its normals by smooth noise of the resting position, region by region.
#include "tests/support/dressed_person.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <stdexcept>

#include "daemon/io/model_file.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"
#include "drivers/synthetic/renderer.hpp"
#include "drivers/synthetic/scene.hpp"
#include "fit/body/exact_math.hpp"
#include "fit/cloud/cloud_builder.hpp"

namespace booth::tests {
namespace {

/// Uniform and normal numbers with the same bits everywhere.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed * 0x9E3779B97F4A7C15ull + 1) {}
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += uniform();
    return sum;
  }
  Eigen::Vector3f direction() {
    Eigen::Vector3d d;
    do {
      d = {normal(), normal(), normal()};
    } while (d.norm() < 1e-3);
    return d.normalized().cast<float>();
  }

 private:
  std::mt19937_64 engine_;
};

/// Smooth random field of unit variance whose waves are about `wavelength` long.
class Waves {
 public:
  Waves(Dice& dice, float wavelength) {
    for (int i = 0; i < kCount; ++i) {
      wave_.push_back(dice.direction() * static_cast<float>(2 * std::numbers::pi / (static_cast<double>(wavelength) * dice.between(0.7, 1.6))));
      phase_.push_back(static_cast<float>(dice.between(0, 2 * std::numbers::pi)));
    }
  }
  float at(const Eigen::Vector3f& p) const {
    float sum = 0;
    for (std::size_t i = 0; i < wave_.size(); ++i) sum += static_cast<float>(fit::exact_sincos(static_cast<double>(wave_[i].dot(p) + phase_[i])).cos);
    return sum * std::sqrt(2.0f / kCount);
  }

 private:
  static constexpr int kCount = 24;
  std::vector<Eigen::Vector3f> wave_;
  std::vector<float> phase_;
};

/// Each triangle becomes four; new vertices lie in the middle of edges.
struct Subdivision {
  std::vector<std::pair<int, int>> middle;
  fit::Faces faces;

  Subdivision(const fit::Faces& coarse, int vertices) : faces(3, 4 * coarse.cols()) {
    std::map<std::pair<int, int>, int> known;
    const auto between = [&](int a, int b) {
      const auto [found, fresh] = known.try_emplace(std::minmax(a, b), vertices + static_cast<int>(middle.size()));
      if (fresh) middle.emplace_back(a, b);
      return found->second;
    };
    for (Eigen::Index f = 0; f < coarse.cols(); ++f) {
      const auto t = coarse.col(f);
      const int ab = between(t[0], t[1]), bc = between(t[1], t[2]), ca = between(t[2], t[0]);
      faces.col(4 * f) << t[0], ab, ca;
      faces.col(4 * f + 1) << ab, t[1], bc;
      faces.col(4 * f + 2) << ca, bc, t[2];
      faces.col(4 * f + 3) << ab, bc, ca;
    }
  }
  template <typename Matrix>
  Matrix refined(const Matrix& coarse) const {
    Matrix out(coarse.rows(), coarse.cols() + static_cast<Eigen::Index>(middle.size()));
    out.leftCols(coarse.cols()) = coarse;
    for (std::size_t i = 0; i < middle.size(); ++i)
      out.col(coarse.cols() + static_cast<Eigen::Index>(i)) = 0.5f * (coarse.col(middle[i].first) + coarse.col(middle[i].second));
    return out;
  }
};

/// Rows: how much of a vertex belongs to the head, hands, feet, and the rest, which clothes cover.
Eigen::MatrixXf regions(const fit::BodyModelData& d) {
  Eigen::MatrixXf out = Eigen::MatrixXf::Zero(4, d.mean.cols());
  for (Eigen::Index v = 0; v < d.mean.cols(); ++v)
    for (int i = 0; i < fit::kSkinBones; ++i) {
      const std::string_view bone = fit::bones()[d.skin_bone(i, v)].name;
      const int row = bone == "head" || bone == "neck" ? 0 : bone.ends_with("hand") ? 1 : bone.ends_with("foot") || bone.ends_with("toes") ? 2 : 3;
      out(row, v) += d.skin_weight(i, v);
    }
  return out;
}

fit::PoseVector pose_named(std::string_view name, const fit::PoseVector& rest, const std::filesystem::path& folder) {
  constexpr std::string_view kTypical = "typical-";
  if (name.starts_with(kTypical)) {
    const auto prior = daemon::load_pose_prior(folder / "pose.npz");
    const auto count = static_cast<int>(prior.exemplars.cols());
    int n = -1;
    const std::string_view digits = name.substr(kTypical.size());
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), n);
    if (error != std::errc() || end != digits.data() + digits.size() || n < 0 || n >= count)
      throw std::invalid_argument(fmt::format("dressed person: there is no pose {}; the pose prior has typical-0 to typical-{}", name, count - 1));
    return prior.exemplars.col(n);
  }
  fit::PoseVector q = rest;
  const auto turn = [&](std::string_view dof, double degrees) { q[fit::dof_index(dof)] += degrees * std::numbers::pi / 180; };
  if (name == "a") {
    turn("lhumerus_rz", 15), turn("rhumerus_rz", -12), turn("lradius_rx", 10);
  } else if (name == "arms-up") {
    turn("lhumerus_rz", -70), turn("rhumerus_rz", 50), turn("rradius_rx", 70), turn("head_ry", 20);
  } else if (name == "stride") {
    turn("lfemur_rx", -35), turn("rfemur_rx", 20), turn("rtibia_rx", 35), turn("lhumerus_ry", 30), turn("rhumerus_ry", 20), turn("upperback_ry", 12);
    turn("lradius_rx", 40);
  } else if (name == "sit") {
    turn("lfemur_rx", -80), turn("rfemur_rx", -75), turn("ltibia_rx", 75), turn("rtibia_rx", 70), turn("lradius_rx", 60);
  } else {
    throw std::invalid_argument("dressed person: unknown pose " + std::string(name) + "; known are a, arms-up, stride, sit, typical-N");
  }
  return q;
}

}  // namespace

DressedPerson dress(const PersonRequest& request) {
  const auto folder = daemon::find_models();
  daemon::TestBody body = daemon::load_test_body(request.bodies.empty() ? folder / "test_bodies.npz" : request.bodies, request.body);
  DressedPerson out;
  out.model = std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / (std::string(to_string(body.sex)) + ".npz")));
  const fit::BodyModelData& d = out.model->data();
  out.rest = body.rest;
  out.measures = fit::Measurer(d).measure(body.rest, body.rest_joints);
  out.q = pose_named(request.pose, out.model->rest_pose(), folder);
  out.q[fit::dof_index("root_ry")] += request.heading * std::numbers::pi / 180;
  out.model->pose_mesh(body.rest, body.rest_joints, out.q, out.skin);
  const float lift = 0.0f - out.skin.row(1).minCoeff() + (request.shoes ? 0.02f : 0.0f);
  out.q[1] += static_cast<double>(lift);
  out.skin.row(1).array() += lift;
  fit::Kinematics kinematics;
  fit::forward_kinematics(out.q, out.model->bone_vectors_from_joints(body.rest_joints), kinematics);
  out.joints = kinematics.joint;

  const Subdivision finer(d.faces, out.model->vertex_count());
  out.outer_faces = finer.faces;
  const fit::Vertices rest = finer.refined(body.rest);
  const Eigen::MatrixXf region = finer.refined(regions(d));
  fit::Vertices skin = finer.refined(out.skin), normals, rest_normals;
  fit::vertex_normals(skin, finer.faces, normals);
  fit::vertex_normals(rest, finer.faces, rest_normals);

  Dice dice(request.seed);
  const Waves small(dice, 0.06f), middle(dice, 0.12f), large(dice, 0.25f), strands(dice, 0.05f);
  const Eigen::Vector3f head_base = body.rest_joints.col(fit::joint_index("head_base")).cast<float>();
  const Eigen::Vector3f head_top = body.rest_joints.col(fit::joint_index("head_top")).cast<float>();
  const float bob = static_cast<float>(dice.between(0.015, 0.045));  // thickness of the hair
  const float lowest = rest.row(1).minCoeff();
  out.outer = skin;
  for (Eigen::Index v = 0; v < rest.cols(); ++v) {
    const Eigen::Vector3f p = rest.col(v);
    const float covered = region(3, v), foot = region(2, v);
    float offset = covered * (0.002f * small.at(p) + 0.003f * middle.at(p));  // skin: folds, muscles
    if (request.outfit == Outfit::tight) offset = covered * std::max(0.002f, 0.006f + 0.004f * small.at(p) + 0.003f * large.at(p));
    if (request.outfit == Outfit::loose)
      offset = covered * std::clamp(0.016f + 0.008f * middle.at(p) + 0.012f * large.at(p) + 0.003f * small.at(p), 0.001f, 0.045f);
    if (request.hair) {
      const float up = (p.y() - head_base.y()) / std::max(0.05f, head_top.y() - head_base.y());
      const float back = (head_base.z() + 0.02f - p.z()) / 0.05f;
      const float cap = std::clamp(std::max(2 * (up - 0.75f), std::min(back, 2 * (up + 0.1f))), 0.0f, 1.0f) * region(0, v);
      offset += cap * bob * (1 + 0.25f * strands.at(p));
    }
    out.outer.col(v) += offset * normals.col(v);
    if (request.shoes) {
      const float sole = std::clamp(1 - (p.y() - lowest - 0.02f) / 0.03f, 0.0f, 1.0f);
      out.outer.col(v) += foot * 0.007f * normals.col(v);
      if (rest_normals(1, v) < -0.5f) out.outer(1, v) -= foot * sole * 0.015f;
    }
  }
  return out;
}

std::uint32_t bones_missing(std::string_view part) {
  const auto bits = [](std::initializer_list<std::string> names) {
    std::uint32_t out = 0;
    for (const std::string& name : names) out |= 1u << fit::bone_index(name);
    return out;
  };
  if (part == "head") return bits({"head", "neck", "neck_fixed"});
  if (part == "arms") return bones_missing("larm") | bones_missing("rarm");
  if (part == "legs") return bones_missing("lleg") | bones_missing("rleg");
  const std::string side(part.substr(0, 1)), name(part.empty() ? part : part.substr(1));
  if (side == "l" || side == "r") {
    if (name == "forearm") return bits({side + "hand", side + "radius"});
    if (name == "arm") return bits({side + "hand", side + "radius", side + "humerus"});
    if (name == "foot") return bits({side + "foot", side + "toes"});
    if (name == "shank") return bits({side + "foot", side + "toes", side + "tibia"});
    if (name == "leg") return bits({side + "foot", side + "toes", side + "tibia", side + "femur"});
  }
  throw std::invalid_argument("dressed person: unknown part " + std::string(part) +
                              "; known are head, arms, legs, and l or r before forearm, arm, foot, shank, leg");
}

Eigen::Matrix3Xf scan_of(const DressedPerson& person, const ScanRequest& request) {
  Dice dice(request.seed ^ 0x5ca1ab1eull);
  const fit::Vertices& v = person.outer;
  const fit::Faces& faces = person.outer_faces;
  std::vector<double> end;
  double area = 0;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3f a = v.col(faces(0, f));
    area += static_cast<double>((v.col(faces(1, f)) - a).cross(v.col(faces(2, f)) - a).norm()) / 2;
    end.push_back(area);
  }
  std::vector<std::pair<Eigen::Vector3f, float>> holes;
  for (int h = 0; h < request.holes; ++h) {
    const auto at = static_cast<Eigen::Index>(dice.uniform() * static_cast<double>(v.cols()));
    holes.emplace_back(v.col(at), static_cast<float>(dice.between(0.04, 0.09)));
  }
  const Eigen::Vector3f elbow = person.joints.col(fit::joint_index("relbow")).cast<float>(),
                        hand = person.joints.col(fit::joint_index("rhand_end")).cast<float>();
  // The bone that most of a triangle belongs to; four fine ones come from each of the template.
  std::vector<int> owner;
  if (request.missing != 0) {
    const fit::BodyModelData& d = person.model->data();
    for (Eigen::Index f = 0; f < d.faces.cols(); ++f) {
      std::array<float, fit::kBones> weight{};
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < fit::kSkinBones; ++i) weight[d.skin_bone(i, d.faces(k, f))] += d.skin_weight(i, d.faces(k, f));
      owner.push_back(static_cast<int>(std::max_element(weight.begin(), weight.end()) - weight.begin()));
    }
  }
  std::vector<Eigen::Vector3f> points;
  const auto noise = [&] { return Eigen::Vector3f(request.noise * Eigen::Vector3d(dice.normal(), dice.normal(), dice.normal()).cast<float>()); };
  for (int i = 0; i < request.points; ++i) {
    // All of a point's numbers are drawn before anything is decided about it: where one machine rounds otherwise than another, that point differs and no later
    // one.
    const auto f = static_cast<Eigen::Index>(std::lower_bound(end.begin(), end.end(), dice.uniform() * area) - end.begin());
    const auto t = faces.col(std::min(f, faces.cols() - 1));
    float s = static_cast<float>(dice.uniform()), r = static_cast<float>(dice.uniform());
    if (s + r > 1) s = 1 - s, r = 1 - r;
    const Eigen::Vector3f p = v.col(t[0]) + s * (v.col(t[1]) - v.col(t[0])) + r * (v.col(t[2]) - v.col(t[0])), moved = p + noise();
    if (!owner.empty() && (request.missing >> owner[static_cast<std::size_t>(std::min(f, faces.cols() - 1) / 4)] & 1u) != 0) continue;
    if (!request.side.isZero() && (v.col(t[1]) - v.col(t[0])).cross(v.col(t[2]) - v.col(t[0])).dot(request.side) <= 0) continue;
    if (std::any_of(holes.begin(), holes.end(), [&](const auto& h) { return (p - h.first).norm() < h.second; })) continue;
    if (request.without_arm) {
      const Eigen::Vector3f along = hand - elbow;
      const float part = (p - elbow).dot(along) / along.squaredNorm();
      if (part > 0 && (p - elbow - part * along).norm() < 0.12f) continue;
    }
    points.push_back(moved);
  }
  if (request.floor) {
    const Eigen::Vector3f middle(static_cast<float>(person.q[0]), 0, static_cast<float>(person.q[2]));
    for (int i = 0; i < request.points / 4; ++i) {
      const double turn = dice.between(0, 2 * std::numbers::pi), radius = std::sqrt(dice.uniform());
      const fit::SinCos at = fit::exact_sincos(turn);
      points.push_back(middle + Eigen::Vector3f(static_cast<float>(radius * at.cos), 0, static_cast<float>(radius * at.sin)) + noise());
    }
  }
  Eigen::Matrix3Xf out(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) out.col(static_cast<Eigen::Index>(i)) = points[i];
  return out;
}

struct CameraView::Impl {
  drivers::SceneSettings settings;
  std::vector<drivers::Renderer> renderers;
  std::unique_ptr<fit::CloudBuilder> builder;
  fit::Observation observation{0};
};

CameraView::CameraView(const std::string& noise, std::uint64_t seed) : impl_(std::make_unique<Impl>()) {
  impl_->settings.cameras = drivers::camera_ring();
  impl_->settings.noise = drivers::NoiseModel::parse(noise);
  impl_->settings.seed = seed;
  std::vector<fit::Camera> cameras;
  for (const auto& camera : impl_->settings.cameras) {
    impl_->renderers.emplace_back(camera, static_cast<int>(cameras.size()), impl_->settings);
    cameras.push_back(daemon::fit_camera(camera));
  }
  impl_->builder = std::make_unique<fit::CloudBuilder>(fit::CloudSettings{}, cameras);
  impl_->observation = impl_->builder->make_observation(120000);
}

CameraView::~CameraView() = default;

bool CameraView::look(const fit::Vertices& vertices, const fit::Faces& faces, std::uint64_t frame) {
  const auto& cameras = impl_->settings.cameras;
  std::vector<std::vector<std::uint16_t>> depth(cameras.size());
  std::vector<fit::DepthInput> inputs;
  const std::vector<std::uint8_t> dark(static_cast<std::size_t>(faces.cols()), 0);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    depth[c].resize(static_cast<std::size_t>(cameras[c].intrinsics.width) * static_cast<std::size_t>(cameras[c].intrinsics.height));
    auto& renderer = impl_->renderers[c];
    renderer.reserve(static_cast<int>(vertices.cols()));
    renderer.begin();
    renderer.draw(vertices, faces, dark);
    renderer.finish(frame, depth[c].data());
    inputs.push_back({.camera = static_cast<int>(c), .depth = depth[c].data()});
  }
  fit::CloudReport report;
  impl_->observation.frame = frame;
  impl_->observation.time = static_cast<double>(frame) / 30;
  return impl_->builder->build(inputs, impl_->observation, report);
}

const fit::Observation& CameraView::observation() const { return impl_->observation; }

}  // namespace booth::tests
