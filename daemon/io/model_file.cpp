// Which key holds what, and every check that a file from somewhere else needs before it becomes a model.
#include "daemon/io/model_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "daemon/io/npz.hpp"

namespace booth::daemon {
namespace {

constexpr int kFormat = 1;
using fit::kBones;
using fit::kJoints;

std::size_t count(Eigen::Index n) { return static_cast<std::size_t>(n); }

/// Row-major copy of an Eigen matrix, as NumPy's C order wants it.
template <typename Matrix>
std::vector<double> row_major(const Matrix& m) {
  std::vector<double> values;
  values.reserve(count(m.size()));
  for (Eigen::Index r = 0; r < m.rows(); ++r)
    for (Eigen::Index c = 0; c < m.cols(); ++c) values.push_back(static_cast<double>(m(r, c)));
  return values;
}

template <typename Scalar = double>
Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> matrix(const std::vector<double>& values, std::size_t rows, std::size_t columns) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(values.data(), static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns)).template cast<Scalar>();
}

Eigen::VectorXd vector(const std::vector<double>& values) { return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())); }

void check_kind(const NpzReader& file, const std::string& kind) {
  if (const auto found = file.text("kind"); found != kind) file.fail("kind", "is '" + found + "', expected '" + kind + "'");
  if (const int format = file.integers("format", {}, 1, 1000)[0]; format != kFormat)
    file.fail("format", "is " + std::to_string(format) + ", this program reads " + std::to_string(kFormat) + "; train the model again with 'boothctl model'");
}

void add_kind(NpzWriter& file, const std::string& kind, const std::string& version) {
  file.add_texts("kind", {kind}, true);
  const double format = kFormat;
  file.add("format", NpzType::i4, {}, std::span(&format, 1));
  file.add_texts("version", {version}, true);
}

std::vector<std::string> joint_names() {
  std::vector<std::string> names;
  for (const auto& b : fit::bones()) names.emplace_back(b.end_joint);
  return names;
}

/// Names the file before what a constructor or check() found.
template <typename Work>
auto with_file(const std::filesystem::path& path, Work&& work) {
  try {
    return work();
  } catch (const std::invalid_argument& e) {
    throw std::runtime_error(path.string() + ": " + e.what());
  }
}

}  // namespace

fit::BodyModelData load_body_model_data(const std::filesystem::path& path, BodyModelExtras* extras) {
  const NpzReader file(path);
  check_kind(file, "boothd-body-model");
  fit::BodyModelData d;
  const auto sex = file.text("sex");
  if (sex != "men" && sex != "women") file.fail("sex", "is '" + sex + "', allowed are men and women");
  d.sex = sex == "men" ? fit::Sex::men : fit::Sex::women;
  d.version = file.text("version");

  const auto mean = file.numbers("v_template", {0, 3});
  const std::size_t vertices = mean.size() / 3;
  if (vertices < 16 || vertices > 200000) file.fail("v_template", "has " + std::to_string(vertices) + " vertices, allowed are 16 to 200000");
  d.mean = matrix<float>(mean, vertices, 3).transpose();
  const auto directions = file.numbers("shapedirs", {vertices, 3, 0});
  const std::size_t components = directions.size() / (3 * vertices);
  if (components < 1 || components > fit::kMaxShape)
    file.fail("shapedirs", "has " + std::to_string(components) + " components, allowed are 1 to " + std::to_string(fit::kMaxShape));
  d.directions = matrix<float>(directions, 3 * vertices, components);
  d.explained = vector(file.numbers("explained", {components}));
  const auto faces = file.integers("f", {0, 3}, 0, static_cast<long>(vertices) - 1);
  d.faces = Eigen::Map<const Eigen::Matrix3Xi>(faces.data(), 3, static_cast<Eigen::Index>(faces.size() / 3));
  d.joint_regressor = matrix(file.numbers("J_regressor", {kJoints, vertices}), kJoints, vertices);
  d.rest_pose = vector(file.numbers("q_rest", {fit::kDofs}));
  const auto mirror = file.integers("mirror_vertex", {vertices}, 0, static_cast<long>(vertices) - 1);
  d.mirror_vertex = Eigen::Map<const Eigen::VectorXi>(mirror.data(), static_cast<Eigen::Index>(mirror.size()));
  if (file.has("landmarks")) {
    const auto landmarks = file.integers("landmarks", {0}, 0, static_cast<long>(vertices) - 1);
    d.landmarks = Eigen::Map<const Eigen::VectorXi>(landmarks.data(), static_cast<Eigen::Index>(landmarks.size()));
  }
  const auto tree = file.integers("kintree_table", {2, kBones}, -1, kBones - 1);
  for (int b = 0; b < kBones; ++b)
    if (tree[static_cast<std::size_t>(b)] != fit::bones()[static_cast<std::size_t>(b)].parent || tree[static_cast<std::size_t>(kBones + b)] != b)
      file.fail("kintree_table", "is not the skeleton that this program drives (24 CMU bones; docs/reference/model-file.md)");

  const auto weights = file.numbers("weights", {vertices, kBones});
  d.skin_bone.setZero(fit::kSkinBones, static_cast<Eigen::Index>(vertices));
  d.skin_weight.setZero(fit::kSkinBones, static_cast<Eigen::Index>(vertices));
  for (std::size_t v = 0; v < vertices; ++v) {
    // The largest four, largest first.
    std::array<std::pair<double, int>, kBones> order;
    for (int b = 0; b < kBones; ++b) order[static_cast<std::size_t>(b)] = {weights[v * kBones + static_cast<std::size_t>(b)], b};
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    double sum = 0, kept = 0;
    for (const auto& [w, b] : order) {
      if (w < 0) file.fail("weights", "holds a negative weight (vertex " + std::to_string(v) + ")");
      sum += w;
    }
    if (std::abs(sum - 1) > 0.01) file.fail("weights", "of vertex " + std::to_string(v) + " sum to " + std::to_string(sum) + ", expected 1");
    for (int i = 0; i < fit::kSkinBones; ++i) kept += order[static_cast<std::size_t>(i)].first;
    for (int i = 0; i < fit::kSkinBones; ++i) {
      const auto& [w, b] = order[static_cast<std::size_t>(i)];
      if (w <= 0) break;
      d.skin_bone(i, static_cast<Eigen::Index>(v)) = static_cast<std::uint8_t>(b);
      d.skin_weight(i, static_cast<Eigen::Index>(v)) = static_cast<float>(w / kept);
    }
  }
  if (extras) {
    extras->template_regressor =
        file.has("J_regressor_template") ? matrix(file.numbers("J_regressor_template", {kJoints, vertices}), kJoints, vertices) : d.joint_regressor;
    if (file.has("sigma")) extras->sigma = vector(file.numbers("sigma", {components}));
    if (file.has("joint_residual")) extras->joint_residual = vector(file.numbers("joint_residual", {kJoints}));
    if (file.has("notes")) extras->notes = file.text("notes");
  }
  return d;
}

fit::BodyModel load_body_model(const std::filesystem::path& path) {
  return with_file(path, [&] { return fit::BodyModel(load_body_model_data(path)); });
}

fit::BodyModel load_body_model_paper(const std::filesystem::path& path) {
  return with_file(path, [&] {
    BodyModelExtras extras;
    auto data = load_body_model_data(path, &extras);
    data.joint_regressor = extras.template_regressor;
    return fit::BodyModel(std::move(data));
  });
}

void save_body_model(const std::filesystem::path& path, const fit::BodyModelData& d, const BodyModelExtras& extras) {
  NpzWriter file;
  add_kind(file, "boothd-body-model", d.version);
  file.add_texts("sex", {fit::to_string(d.sex)}, true);
  const std::size_t vertices = count(d.mean.cols()), components = count(d.directions.cols());
  file.add("v_template", NpzType::f4, {vertices, 3}, row_major(d.mean.transpose()));
  file.add("shapedirs", NpzType::f2, {vertices, 3, components}, row_major(d.directions));
  file.add("explained", NpzType::f8, {components}, row_major(d.explained));
  file.add("sigma", NpzType::f8, {components}, row_major(extras.sigma));
  file.add("f", NpzType::i4, {count(d.faces.cols()), 3}, row_major(d.faces.transpose()));
  file.add("J_regressor", NpzType::f4, {kJoints, vertices}, row_major(d.joint_regressor));
  file.add("J_regressor_template", NpzType::f4, {kJoints, vertices}, row_major(extras.template_regressor));
  std::vector<double> weights(vertices * kBones, 0.0);
  for (std::size_t v = 0; v < vertices; ++v)
    for (int i = 0; i < fit::kSkinBones; ++i)
      weights[v * kBones + d.skin_bone(i, static_cast<Eigen::Index>(v))] += static_cast<double>(d.skin_weight(i, static_cast<Eigen::Index>(v)));
  file.add("weights", NpzType::f4, {vertices, kBones}, weights);
  std::vector<double> tree;
  for (const auto& b : fit::bones()) tree.push_back(b.parent);
  for (int b = 0; b < kBones; ++b) tree.push_back(b);
  file.add("kintree_table", NpzType::i4, {2, kBones}, tree);
  std::vector<std::string> bone_names;
  for (const auto& b : fit::bones()) bone_names.emplace_back(b.name);
  file.add_texts("bone_names", bone_names);
  file.add_texts("joint_names", joint_names());
  file.add("q_rest", NpzType::f8, {fit::kDofs}, row_major(d.rest_pose));
  file.add("mirror_vertex", NpzType::i4, {vertices}, row_major(d.mirror_vertex));
  file.add("landmarks", NpzType::i4, {count(d.landmarks.size())}, row_major(d.landmarks));
  if (extras.joint_residual.size() == kJoints) file.add("joint_residual", NpzType::f4, {kJoints}, row_major(extras.joint_residual));
  file.add_texts("notes", {extras.notes}, true);
  file.save(path);
}

fit::PosePrior load_pose_prior(const std::filesystem::path& path) {
  const NpzReader file(path);
  check_kind(file, "boothd-pose-prior");
  fit::PosePrior p;
  constexpr std::size_t n = fit::kPoseDofs;
  p.version = file.text("version");
  p.mean = vector(file.numbers("mean", {n}));
  const auto components = file.numbers("components", {n, 0});
  if (components.size() > n * n) file.fail("components", "has more columns than there are angles");
  p.components = matrix(components, n, components.size() / n);
  p.sigma = vector(file.numbers("sigma", {components.size() / n}));
  p.standard_deviation = vector(file.numbers("standard_deviation", {n}));
  p.lower = vector(file.numbers("lower", {n}));
  p.upper = vector(file.numbers("upper", {n}));
  p.speed_limit = vector(file.numbers("speed_limit", {fit::kDofs}));
  const auto exemplars = file.numbers("exemplars", {0, fit::kDofs});
  if (exemplars.size() > 100000u * fit::kDofs) file.fail("exemplars", "has more than 100000 poses");
  p.exemplars = matrix(exemplars, exemplars.size() / fit::kDofs, fit::kDofs).transpose();
  with_file(path, [&] { p.check(); });
  return p;
}

void save_pose_prior(const std::filesystem::path& path, const fit::PosePrior& p) {
  NpzWriter file;
  constexpr std::size_t n = fit::kPoseDofs;
  add_kind(file, "boothd-pose-prior", p.version);
  file.add("mean", NpzType::f8, {n}, row_major(p.mean));
  file.add("components", NpzType::f8, {n, count(p.components.cols())}, row_major(p.components));
  file.add("sigma", NpzType::f8, {count(p.sigma.size())}, row_major(p.sigma));
  file.add("standard_deviation", NpzType::f8, {n}, row_major(p.standard_deviation));
  file.add("lower", NpzType::f8, {n}, row_major(p.lower));
  file.add("upper", NpzType::f8, {n}, row_major(p.upper));
  file.add("speed_limit", NpzType::f8, {fit::kDofs}, row_major(p.speed_limit));
  file.add("exemplars", NpzType::f4, {count(p.exemplars.cols()), fit::kDofs}, row_major(p.exemplars.transpose()));
  std::vector<std::string> names;
  for (int d = 0; d < fit::kDofs; ++d) names.emplace_back(fit::dof_name(d));
  file.add_texts("dof_names", names);
  file.save(path);
}

namespace {

/// Vertices are stored as 16-bit steps from the mean of their sex; high and low bytes stand apart, because only the high ones pack well.
constexpr double kStep = 5e-5;     // metres
constexpr double kOffset = 32768;  // the step that means no difference

std::vector<TestBody> read_test_bodies(const std::filesystem::path& path, int only) {
  const NpzReader file(path);
  check_kind(file, "boothd-test-bodies");
  const auto sexes = file.texts("sex");
  const std::size_t bodies = sexes.size();
  if (bodies < 1 || bodies > 1000) file.fail("sex", "lists " + std::to_string(bodies) + " bodies, allowed are 1 to 1000");
  if (only > static_cast<int>(bodies) || only < 0)
    throw std::runtime_error(path.string() + ": there is no test body " + std::to_string(only) + "; they are numbered from 1 to " + std::to_string(bodies));
  const auto subjects = file.integers("subject", {bodies}, 0, 1000000000);
  const auto joints = file.numbers("joints", {bodies, kJoints, 3});
  const auto high_byte = file.array("high_byte"), low_byte = file.array("low_byte");
  if (high_byte.type != NpzType::u1 || high_byte.shape.size() != 3 || high_byte.shape[0] != bodies || high_byte.shape[2] != 3)
    file.fail("high_byte", "is not a u1 array of shape (bodies, vertices, 3)");
  if (low_byte.type != NpzType::u1 || low_byte.shape != high_byte.shape) file.fail("low_byte", "has not the shape of high_byte");
  const std::size_t vertices = high_byte.shape[1];
  if (vertices < 16 || vertices > 200000) file.fail("high_byte", "has " + std::to_string(vertices) + " vertices, allowed are 16 to 200000");
  const auto base = file.numbers("base", {2, vertices, 3});
  const auto names = file.texts("measure_names");
  const auto measures = file.numbers("measures", {bodies, names.size()});

  std::vector<TestBody> list;
  for (std::size_t b = 0; b < bodies; ++b) {
    if (only > 0 && static_cast<int>(b) != only - 1) continue;
    TestBody body;
    if (sexes[b] != "men" && sexes[b] != "women") file.fail("sex", "holds '" + sexes[b] + "', allowed are men and women");
    body.sex = sexes[b] == "men" ? fit::Sex::men : fit::Sex::women;
    body.subject = subjects[b];
    body.rest.resize(3, static_cast<Eigen::Index>(vertices));
    for (std::size_t v = 0; v < vertices; ++v) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t at = (b * vertices + v) * 3 + i;
        const double step = high_byte.number(at) * 256 + low_byte.number(at) - kOffset;
        body.rest(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(v)) =
            static_cast<float>(base[((body.sex == fit::Sex::men ? 0 : vertices) + v) * 3 + i] + step * kStep);
      }
    }
    for (int j = 0; j < kJoints; ++j)
      for (int i = 0; i < 3; ++i) body.rest_joints(i, j) = joints[(b * kJoints + static_cast<std::size_t>(j)) * 3 + static_cast<std::size_t>(i)];
    for (std::size_t m = 0; m < names.size(); ++m) body.measurements.emplace_back(names[m], measures[b * names.size() + m]);
    list.push_back(std::move(body));
  }
  return list;
}

}  // namespace

std::vector<TestBody> load_test_bodies(const std::filesystem::path& path) { return read_test_bodies(path, 0); }

TestBody load_test_body(const std::filesystem::path& path, int number) {
  if (number < 1) throw std::runtime_error(path.string() + ": there is no test body " + std::to_string(number) + "; they are numbered from 1");
  return std::move(read_test_bodies(path, number).front());
}

void save_test_bodies(const std::filesystem::path& path, const std::vector<TestBody>& bodies) {
  if (bodies.empty()) throw std::invalid_argument("there are no test bodies to save");
  NpzWriter file;
  add_kind(file, "boothd-test-bodies", "1");
  std::vector<std::string> sexes, names;
  std::vector<double> subjects, base, high_byte, low_byte, joints, measures;
  const std::size_t vertices = count(bodies[0].rest.cols());
  for (const auto& [name, value] : bodies[0].measurements) names.push_back(name);
  for (const fit::Sex sex : {fit::Sex::men, fit::Sex::women}) {
    Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(vertices));
    double members = 0;
    for (const auto& b : bodies)
      if (b.sex == sex) mean += b.rest.cast<double>(), members += 1;
    if (members > 0) mean /= members;
    for (float value : mean.cast<float>().reshaped()) base.push_back(static_cast<double>(value));  // as it will be read
  }
  for (const auto& b : bodies) {
    if (count(b.rest.cols()) != vertices || b.measurements.size() != names.size())
      throw std::invalid_argument("test bodies do not share one topology and one list of measures");
    sexes.emplace_back(fit::to_string(b.sex));
    subjects.push_back(b.subject);
    const std::size_t first = b.sex == fit::Sex::men ? 0 : 3 * vertices;
    for (Eigen::Index v = 0; v < b.rest.cols(); ++v)
      for (int i = 0; i < 3; ++i) {
        const double difference = static_cast<double>(b.rest(i, v)) - base[first + count(3 * v + i)];
        const double step = std::clamp(std::nearbyint(difference / kStep) + kOffset, 0.0, 65535.0);
        high_byte.push_back(std::floor(step / 256));
        low_byte.push_back(step - 256 * std::floor(step / 256));
      }
    for (int j = 0; j < kJoints; ++j)
      for (int i = 0; i < 3; ++i) joints.push_back(b.rest_joints(i, j));
    for (const auto& [name, value] : b.measurements) measures.push_back(value);
  }
  const std::size_t n = bodies.size();
  file.add_texts("sex", sexes);
  file.add("subject", NpzType::i4, {n}, subjects);
  file.add("base", NpzType::f4, {2, vertices, 3}, base);
  file.add("high_byte", NpzType::u1, {n, vertices, 3}, high_byte);
  file.add("low_byte", NpzType::u1, {n, vertices, 3}, low_byte);
  file.add("joints", NpzType::f8, {n, kJoints, 3}, joints);
  file.add_texts("joint_names", joint_names());
  file.add_texts("measure_names", names);
  file.add("measures", NpzType::f8, {n, names.size()}, measures);
  file.save(path);
}

std::filesystem::path find_models(const std::filesystem::path& explicit_dir) {
  std::vector<std::filesystem::path> places;
  if (!explicit_dir.empty()) {
    places = {explicit_dir};
  } else if (const char* set = std::getenv("BOOTHD_MODELS"); set && *set) {
    places = {set};
  } else {
    places = {"/usr/share/boothd/models", BOOTHD_SOURCE_MODELS};
  }
  std::string looked;
  for (const auto& place : places) {
    std::error_code error;
    if (std::filesystem::is_regular_file(place / "men.npz", error) || std::filesystem::is_regular_file(place / "women.npz", error)) return place;
    looked += (looked.empty() ? "" : ", ") + place.string();
  }
  throw std::runtime_error("no body models (men.npz, women.npz) in " + looked + "; set BOOTHD_MODELS to the folder that holds them");
}

}  // namespace booth::daemon
