// The order of things: average body, template, joints and skinning, landmarks, a database for each sex, components, regressors, rest pose.
#include "fit/train/shape_training.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <thread>

#include "fit/train/joints.hpp"
#include "fit/train/pca.hpp"
#include "fit/train/rest_pose.hpp"
#include "fit/train/skinning.hpp"

namespace booth::fit::train {
namespace {

Points3 joints_of(const Stacked& body) { return Eigen::Map<const Eigen::Matrix<float, 3, kJoints>>(body.data() + body.size() - 3 * kJoints).cast<double>(); }
Vertices vertices_of(const Stacked& body) { return Eigen::Map<const Vertices>(body.data(), 3, body.size() / 3 - kJoints); }

/// Runs work(i) for i in [0, count) on some threads; results must not depend on the order.
void in_parallel(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  std::vector<std::thread> pool;
  const auto run = [&] {
    for (int i; (i = next.fetch_add(1)) < count;) work(i);
  };
  for (int t = 1; t < threads; ++t) pool.emplace_back(run);
  run();
  for (auto& t : pool) t.join();
}

/// Base vertices of a person halfway between the middle man and the middle woman.
Eigen::Matrix3Xd average_person(const BaseBody& base) {
  Eigen::Matrix3Xd p = base.vertices;
  const auto add = [&](const std::string& name, double weight) {
    const auto found = base.targets.find(name);
    if (found == base.targets.end()) throw std::invalid_argument("the base body has no target " + name);
    for (std::size_t i = 0; i < found->second.vertex.size(); ++i) p.col(found->second.vertex[i]) += weight * found->second.offset[i].cast<double>();
  };
  for (const std::string sex : {"male", "female"}) {
    add("macrodetails/universal-" + sex + "-young-averagemuscle-averageweight", 0.5);
    for (const std::string race : {"caucasian", "asian", "african"}) add("macrodetails/" + race + "-" + sex + "-young", 0.5 / 3);
  }
  return p;
}

int nearest(const Vertices& vertices, const Eigen::Vector3f& point, const std::function<bool(int)>& allowed) {
  int best = -1;
  for (int v = 0; v < vertices.cols(); ++v)
    if (allowed(v) && (best < 0 || (vertices.col(v) - point).squaredNorm() < (vertices.col(best) - point).squaredNorm())) best = v;
  return best;
}

/// Where a target moves the skin most, on the left side.
Eigen::Vector3f peak_of(const BaseBody& base, const Eigen::Matrix3Xd& positions, const std::string& target) {
  const auto found = base.targets.find(target);
  if (found == base.targets.end()) throw std::invalid_argument("the base body has no target " + target);
  int best = -1;
  float largest = 0;
  for (std::size_t i = 0; i < found->second.vertex.size(); ++i) {
    const int v = found->second.vertex[i];
    if (v >= base.skin_vertices || base.vertices(0, v) < -1e-6) continue;
    if (const float size = found->second.offset[i].norm(); size > largest) largest = size, best = v;
  }
  if (best < 0) throw std::invalid_argument("the target " + target + " moves nothing");
  return positions.col(best).cast<float>();
}

Eigen::VectorXi find_landmarks(const BaseBody& base, const Eigen::Matrix3Xd& positions, const TemplateMesh& mesh, const Points3& joints) {
  const Vertices& v = mesh.average;
  const auto any = [](int) { return true; };
  const auto midline = [&](int i) { return mesh.mirror_vertex[i] == i; };
  const auto joint = [&](std::string_view name) -> Eigen::Vector3f { return joints.col(joint_index(name)).cast<float>(); };
  Eigen::VectorXi landmark(kLandmarks);
  const auto set = [&](Landmark which, int vertex) { landmark[static_cast<int>(which)] = vertex; };
  set(Landmark::nipple, nearest(v, peak_of(base, positions, "breast/breast-point-incr"), any));
  set(Landmark::navel, nearest(v, peak_of(base, positions, "stomach/stomach-navel-out"), midline));
  // The buttock's rearmost point between the knee and the root; the crotch is the lowest of the midline.
  int buttock = -1, crotch = -1, acromion = -1;
  const Eigen::Vector3f hip = joint("lhip"), knee = joint("lknee"), root = joint("root"), shoulder = joint("lshoulder");
  for (int i = 0; i < v.cols(); ++i) {
    if (v(0, i) > 0.02f && v(1, i) < root.y() && v(1, i) > knee.y() + 0.5f * (hip.y() - knee.y()) && (buttock < 0 || v(2, i) < v(2, buttock))) buttock = i;
    if (midline(i) && (crotch < 0 || v(1, i) < v(1, crotch))) crotch = i;
    // The acromion: the highest skin within 2 cm of the vertical line 3.5 cm outside the shoulder's centre.
    if (std::hypot(v(0, i) - shoulder.x() - 0.035f, v(2, i) - shoulder.z()) < 0.02f && (acromion < 0 || v(1, i) > v(1, acromion))) acromion = i;
  }
  set(Landmark::buttock, buttock);
  set(Landmark::crotch, crotch);
  set(Landmark::acromion, acromion);
  // The palpable trochanter lies below the hip's centre (at 51.5 % of stature in the survey; this puts it there).
  set(Landmark::trochanterion, nearest(v, hip + Eigen::Vector3f(0.1f, -0.01f, 0), any));
  if (landmark.minCoeff() < 0) throw std::invalid_argument("a landmark was not found on the template");
  return landmark;
}

struct Shared {
  const BodyGenerator& generator;
  const Measurer& measurer;
  const BodyModelData& blank;  ///< topology, skinning, landmarks
  const ShapeTrainingSettings& settings;
  const std::function<void(const std::string&)>& progress;
};

std::vector<FittedBody> make_bodies(const Shared& shared, const std::vector<Person>& people, std::uint64_t stream) {
  const PersonFitter fitter(shared.generator, shared.measurer);
  std::vector<FittedBody> bodies(people.size());
  std::atomic<int> done{0};
  in_parallel(static_cast<int>(people.size()), shared.settings.threads, [&](int i) {
    const auto& person = people[static_cast<std::size_t>(i)];
    bodies[static_cast<std::size_t>(i)] = fitter.fit(person, Random(shared.settings.seed ^ stream, static_cast<std::uint64_t>(person.subject)));
    if (const int n = ++done; n % 250 == 0) shared.progress(std::to_string(n) + " of " + std::to_string(people.size()) + " bodies");
  });
  return bodies;
}

/// Components of the symmetric and of the antisymmetric part, merged: the same as adding every body's mirror image to the database.
void find_components(const Eigen::MatrixXf& bodies, const Shared& shared, BodyModelData& model) {
  const Eigen::Index count = model.mirror_vertex.size(), samples = bodies.cols();
  Eigen::MatrixXf half(3 * count, samples);
  const auto mirrored = [&](Eigen::Index v, Eigen::Index s) -> Eigen::Vector3f {
    Eigen::Vector3f p = bodies.col(s).segment<3>(3 * model.mirror_vertex[v]);
    p.x() = -p.x();
    return p;
  };
  const auto fill = [&](float sign) {
    for (Eigen::Index s = 0; s < samples; ++s)
      for (Eigen::Index v = 0; v < count; ++v) half.col(s).segment<3>(3 * v) = 0.5f * (bodies.col(s).segment<3>(3 * v) + sign * mirrored(v, s));
  };
  fill(1);
  const Eigen::VectorXf mean = (half.cast<double>().rowwise().sum() / static_cast<double>(samples)).cast<float>();
  half.colwise() -= mean;
  const Components even = principal_components(half, kMaxShape);
  fill(-1);
  const Components odd = principal_components(half, kMaxShape);

  model.mean = mean.reshaped(3, count);
  const double total = even.variance.sum() + odd.variance.sum();
  std::vector<std::pair<double, Eigen::VectorXf>> kept;
  std::vector<double> explained;
  Eigen::Index e = 0, o = 0;
  double sum = 0;
  while (static_cast<int>(kept.size()) < kMaxShape && sum < shared.settings.kept_variance * total) {
    const bool take_even = o >= odd.direction.cols() || (e < even.direction.cols() && even.variance[e] >= odd.variance[o]);
    const auto& part = take_even ? even : odd;
    const Eigen::Index i = take_even ? e++ : o++;
    if (i >= part.direction.cols()) break;
    sum += part.variance[i];
    kept.emplace_back(part.variance[i], part.direction.col(i));
    explained.push_back(sum / total);
  }
  model.directions.resize(3 * count, static_cast<Eigen::Index>(kept.size()));
  model.explained.resize(static_cast<Eigen::Index>(kept.size()));
  for (std::size_t k = 0; k < kept.size(); ++k) {
    model.directions.col(static_cast<Eigen::Index>(k)) = static_cast<float>(std::sqrt(kept[k].first)) * kept[k].second;
    model.explained[static_cast<Eigen::Index>(k)] = explained[k];
  }
}

TrainedShape train_one(Sex sex, const Survey& survey, const Shared& shared) {
  TrainedShape out;
  out.model = shared.blank;
  out.model.sex = sex;
  if (survey.bodies < 32 || survey.bodies > static_cast<int>(survey.training.size()))
    throw std::invalid_argument(std::string("the survey has ") + std::to_string(survey.training.size()) + " " + to_string(sex) + ", " +
                                std::to_string(survey.bodies) + " are wanted");

  // Drawn without replacement, then widened; some more than needed, because not everybody can be made.
  std::vector<Person> people = survey.training;
  Random draw(shared.settings.seed, sex == Sex::men ? 11 : 12);
  const std::size_t drawn = std::min(people.size(), static_cast<std::size_t>(survey.bodies) * 9 / 8);
  for (std::size_t i = 0; i < drawn; ++i) std::swap(people[i], people[i + draw.next() % (people.size() - i)]);
  people.resize(drawn);
  const Widener widener(survey.training, survey.stature_sd, survey.mass_sd);
  for (auto& p : people) p = widener.widen(p);

  auto fitted = make_bodies(shared, people, 0);
  const auto held_out = make_bodies(shared, survey.held_out, 1);
  out.bodies = survey.bodies;
  std::erase_if(fitted, [](const FittedBody& b) { return !b.matches(); });
  out.rejected = static_cast<int>(drawn - fitted.size());
  if (static_cast<int>(fitted.size()) < survey.bodies)
    throw std::invalid_argument("only " + std::to_string(fitted.size()) + " of " + std::to_string(drawn) + " " + to_string(sex) +
                                " could be made from the base body");
  fitted.resize(static_cast<std::size_t>(survey.bodies));
  Eigen::MatrixXf bodies(shared.generator.stacked_size(), survey.bodies);
  std::array<double, kMeasures> squares{};
  for (int i = 0; i < survey.bodies; ++i) {
    auto& b = fitted[static_cast<std::size_t>(i)];
    bodies.col(i) = b.body;
    const FittedMeasures error = b.error.cwiseAbs();
    out.error_mean += error / survey.bodies;
    out.error_worst = out.error_worst.cwiseMax(error);
    const auto m = shared.measurer.measure(vertices_of(b.body), joints_of(b.body));
    for (std::size_t k = 0; k < m.size(); ++k) out.measure_mean[k] += m[k] / survey.bodies, squares[k] += m[k] * m[k] / survey.bodies;
    b.body.resize(0);
  }
  for (std::size_t k = 0; k < squares.size(); ++k) out.measure_sd[k] = std::sqrt(std::max(0.0, squares[k] - out.measure_mean[k] * out.measure_mean[k]));

  shared.progress(std::string(to_string(sex)) + ": joint regressors");
  const Eigen::Index count = shared.blank.mirror_vertex.size();
  const Eigen::VectorXd mean = bodies.cast<double>().rowwise().mean();
  // The mean body and its mirror image, halved.
  const auto symmetric = [&](Eigen::Index here, Eigen::Index there) -> Eigen::Vector3d {
    const Eigen::Vector3d a = mean.segment<3>(3 * here), b = mean.segment<3>(3 * there);
    return (a + Eigen::Vector3d(-b.x(), b.y(), b.z())) / 2;
  };
  RegressorInput input{Vertices(3, count), Points3::Zero(), out.model.mirror_vertex, &bodies};
  for (Eigen::Index v = 0; v < count; ++v) input.mean.col(v) = symmetric(v, out.model.mirror_vertex[v]).cast<float>();
  for (int j = 0; j < kJoints; ++j) input.mean_joints.col(j) = symmetric(count + j, count + mirror_bone(j));
  out.model.joint_regressor = train_joint_regressor(input);
  input.bodies = nullptr;
  out.template_regressor = train_joint_regressor(input);
  out.model.rest_pose = solve_rest_pose(input.mean_joints);

  // A fitted body knows only its regressed root, so that is where the components are centred too.
  shared.progress(std::string(to_string(sex)) + ": components");
  const Eigen::VectorXf root_row = out.model.joint_regressor.row(0).cast<float>();
  for (Eigen::Index b = 0; b < bodies.cols(); ++b) {
    auto points = bodies.col(b).reshaped(3, count + kJoints);
    const Eigen::Vector3f root = points.leftCols(count) * root_row;
    points.colwise() -= root;
  }
  find_components(bodies.topRows(3 * count), shared, out.model);

  // What remains on bodies that nothing above has seen.
  out.joint_residual = Eigen::VectorXd::Zero(kJoints);
  out.template_joint_residual = Eigen::VectorXd::Zero(kJoints);
  const double share = 1.0 / static_cast<double>(held_out.size());
  for (std::size_t i = 0; i < held_out.size(); ++i) {
    HeldOutBody body{survey.held_out[i], vertices_of(held_out[i].body), joints_of(held_out[i].body), {}};
    body.measures = shared.measurer.measure(body.rest, body.rest_joints);
    const Eigen::MatrixXd points = body.rest.cast<double>();
    const Points3 regressed = points * out.model.joint_regressor.transpose(), by_template = points * out.template_regressor.transpose();
    out.joint_residual += share * (regressed - body.rest_joints).colwise().norm().transpose();
    out.template_joint_residual += share * (by_template - body.rest_joints).colwise().norm().transpose();
    const Vertices centred = body.rest.colwise() - regressed.col(0).cast<float>();
    const Eigen::VectorXf deviation = centred.reshaped() - out.model.mean.reshaped();
    Eigen::VectorXf rest = deviation;
    for (Eigen::Index k = 0; k < out.model.directions.cols(); ++k) {
      const auto d = out.model.directions.col(k);
      rest -= d * (d.dot(deviation) / d.squaredNorm());
    }
    out.held_out_surface += share * static_cast<double>(rest.reshaped(3, count).colwise().norm().mean());
    out.held_out.push_back(std::move(body));
  }
  return out;
}

}  // namespace

ShapeTraining train_shapes(const BaseBody& base, const Survey& men, const Survey& women, const ShapeTrainingSettings& settings,
                           const std::function<void(const std::string&)>& progress) {
  ShapeTraining out;
  const Eigen::Matrix3Xd average = average_person(base);
  out.mesh = make_template(base, average, settings.edge_length);
  const auto report = inspect(out.mesh.average, out.mesh.faces);
  progress("template: " + std::to_string(report.vertices) + " vertices, edges " + std::to_string(report.edge_mean * 100).substr(0, 4) + " cm");
  if (report.open_edges || report.overused_edges || report.components != 1 || report.euler() != 2)
    throw std::invalid_argument("the template is not one closed surface of genus 0");

  const auto joint_rule = joint_rows(base);
  BodyModelData blank;
  blank.faces = out.mesh.faces;
  blank.mirror_vertex = out.mesh.mirror_vertex;
  blank.mean = out.mesh.average;
  transfer_skinning(base, out.mesh, blank);
  Points3 joints;
  for (int j = 0; j < kJoints; ++j) {
    joints.col(j).setZero();
    for (const auto& [v, w] : joint_rule[static_cast<std::size_t>(j)]) joints.col(j) += w * average.col(v);
  }
  blank.landmarks = find_landmarks(base, average, out.mesh, joints);

  auto rows = out.mesh.rows;
  rows.insert(rows.end(), joint_rule.begin(), joint_rule.end());
  const BodyGenerator generator(base, rows);
  const Measurer measurer(blank);
  const Shared shared{generator, measurer, blank, settings, progress};
  out.men = train_one(Sex::men, men, shared);
  out.women = train_one(Sex::women, women, shared);
  return out;
}

}  // namespace booth::fit::train
