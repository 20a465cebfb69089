// The committed models: they load, are symmetric and closed, fit the set-aside bodies, and rest where q_rest says.
#include "daemon/io/model_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <set>

#include "daemon/io/ansur.hpp"
#include "daemon/io/npz.hpp"
#include "fit/body/measure.hpp"
#include "fit/train/random.hpp"
#include "fit/train/template_mesh.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using fit::kBones;
using fit::kJoints;

const fs::path kModels = fs::path(BOOTH_SOURCE_DIR) / "fit" / "models";

/// Loaded once for all cases.
const fit::BodyModel& model(fit::Sex sex) {
  static const fit::BodyModel men = load_body_model(kModels / "men.npz"), women = load_body_model(kModels / "women.npz");
  return sex == fit::Sex::men ? men : women;
}
const std::vector<TestBody>& test_bodies() {
  static const auto bodies = load_test_bodies(kModels / "test_bodies.npz");
  return bodies;
}

class CommittedModel : public testing::TestWithParam<fit::Sex> {
 protected:
  const fit::BodyModel& m = model(GetParam());
};
INSTANTIATE_TEST_SUITE_P(BothSexes, CommittedModel, testing::Values(fit::Sex::men, fit::Sex::women),
                         [](const auto& i) { return std::string(to_string(i.param)); });

TEST_P(CommittedModel, IsOneClosedEvenSurface) {
  EXPECT_EQ(m.sex(), GetParam());
  const auto report = fit::train::inspect(m.data().mean, m.data().faces);
  EXPECT_EQ(report.open_edges, 0);
  EXPECT_EQ(report.overused_edges, 0);
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.euler(), 2);
  EXPECT_GT(report.vertices, 5000);
  EXPECT_LT(report.vertices, 7000);
  EXPECT_GT(report.edge_p05, 0.5 * report.edge_mean);
  EXPECT_LT(report.edge_p95, 1.5 * report.edge_mean);
}

TEST_P(CommittedModel, MeanBodyTopologyWeightsAndRegressorAreSymmetric) {
  const auto& d = m.data();
  std::set<std::array<int, 3>> faces;
  const auto key = [](int a, int b, int c) {  // the same for all rotations
    if (b < a && b < c) return std::array{b, c, a};
    if (c < a && c < b) return std::array{c, a, b};
    return std::array{a, b, c};
  };
  for (Eigen::Index f = 0; f < d.faces.cols(); ++f) faces.insert(key(d.faces(0, f), d.faces(1, f), d.faces(2, f)));
  for (Eigen::Index f = 0; f < d.faces.cols(); ++f)
    EXPECT_TRUE(faces.contains(key(d.mirror_vertex[d.faces(0, f)], d.mirror_vertex[d.faces(2, f)], d.mirror_vertex[d.faces(1, f)])));
  for (int v = 0; v < m.vertex_count(); ++v) {
    const int o = d.mirror_vertex[v];
    ASSERT_EQ(d.mirror_vertex[o], v);
    EXPECT_LT((Eigen::Vector3f(-d.mean(0, o), d.mean(1, o), d.mean(2, o)) - d.mean.col(v)).norm(), 2e-5f);
    Eigen::VectorXf here = Eigen::VectorXf::Zero(kBones), there = here;
    for (int i = 0; i < fit::kSkinBones; ++i) {
      here[d.skin_bone(i, v)] += d.skin_weight(i, v);
      there[fit::mirror_bone(d.skin_bone(i, o))] += d.skin_weight(i, o);
    }
    EXPECT_LT((here - there).cwiseAbs().maxCoeff(), 1e-4f);
    EXPECT_NEAR(here.sum(), 1, 1e-6);
    for (int j = 0; j < kJoints; ++j) EXPECT_NEAR(d.joint_regressor(j, v), d.joint_regressor(fit::mirror_bone(j), o), 1e-6);
  }
  EXPECT_LT((fit::mirror(m.rest_pose()) - m.rest_pose()).norm(), 1e-9);
}

TEST_P(CommittedModel, OnlyBonesThatTurnCarrySkin) {
  std::array<float, kBones> total{};
  for (int v = 0; v < m.vertex_count(); ++v)
    for (int i = 0; i < fit::kSkinBones; ++i) total[m.data().skin_bone(i, v)] += m.data().skin_weight(i, v);
  for (int b = 0; b < kBones; ++b) {
    const auto& bone = fit::bones()[static_cast<std::size_t>(b)];
    const bool turns = b == 0 || bone.dof != std::array{-1, -1, -1};
    EXPECT_EQ(total[static_cast<std::size_t>(b)] > 0, turns) << bone.name;
  }
}

TEST_P(CommittedModel, RestPoseReproducesTheShapedMesh) {
  fit::ShapeVector beta = fit::ShapeVector::Zero(m.shape_count());
  beta[0] = 1.5, beta[1] = -2, beta[2] = 1;
  fit::Vertices shaped, posed;
  m.shaped(beta, shaped);
  m.posed(beta, m.rest_pose(), posed);
  EXPECT_LT((shaped - posed).colwise().norm().maxCoeff(), 1e-6f);
}

TEST_P(CommittedModel, TPoseStretchesTheArmsAndLegs) {
  fit::Vertices posed;
  fit::PoseVector q = fit::PoseVector::Zero();
  m.posed(fit::ShapeVector(), q, posed);
  fit::Kinematics kin;
  fit::forward_kinematics(q, m.bone_vectors(fit::ShapeVector()), kin);
  const auto joint = [&](const char* name) -> Eigen::Vector3d { return kin.joint.col(fit::joint_index(name)); };
  const Eigen::Vector3d arm = (joint("lwrist") - joint("lshoulder")).normalized(), leg = (joint("lankle") - joint("lhip")).normalized();
  EXPECT_GT(arm.x(), 0.98);
  EXPECT_GT(-leg.y(), 0.9);
  EXPECT_NEAR(leg.x(), std::sin(20 * 3.14159265 / 180), 0.06);
  EXPECT_NEAR(posed.row(0).maxCoeff(), -posed.row(0).minCoeff(), 1e-4);
  EXPECT_GT(posed.row(0).maxCoeff(), 0.7f);
  EXPECT_GT(joint("head_top").y(), joint("head_base").y());
}

TEST_P(CommittedModel, DirectionsAreWhitenedAndExplainedGrows) {
  const auto& d = m.data();
  EXPECT_GE(d.explained[d.explained.size() - 1], 0.98);
  for (Eigen::Index k = 1; k < d.explained.size(); ++k) {
    EXPECT_GT(d.explained[k], d.explained[k - 1]);
    EXPECT_LE(d.directions.col(k).norm(), 1.001f * d.directions.col(k - 1).norm());
  }
}

TEST_P(CommittedModel, MeanBodyHasHumanMeasures) {
  std::map<std::string_view, double> mean;
  for (const auto& x : fit::measure(m, fit::ShapeVector())) mean[x.name] = x.value;
  const bool men = GetParam() == fit::Sex::men;
  EXPECT_NEAR(mean["stature"], men ? 1.756 : 1.629, 0.02);
  EXPECT_NEAR(mean["mass"], men ? 85.5 : 67.8, 5);
  EXPECT_NEAR(mean["chest_girth"], men ? 1.059 : 0.947, 0.04);
  EXPECT_NEAR(mean["waist_girth"], men ? 0.941 : 0.861, 0.05);
  EXPECT_NEAR(mean["crotch_height"], men ? 0.846 : 0.782, 0.04);
}

TEST_P(CommittedModel, RegressedJointsAreNearTheTrueOnesOfSetAsideBodies) {
  double sum = 0;
  int bodies = 0;
  for (const auto& body : test_bodies()) {
    if (body.sex != GetParam()) continue;
    const fit::Points3 joints = body.rest.cast<double>() * m.data().joint_regressor.transpose();
    sum += (joints - body.rest_joints).colwise().norm().mean();
    ++bodies;
  }
  EXPECT_EQ(bodies, 45);
  EXPECT_LT(sum / bodies, 5e-3);
}

TEST_P(CommittedModel, SetAsideBodiesAreNotInTheSpaceButNearIt) {
  double sum = 0;
  int bodies = 0;
  for (const auto& body : test_bodies()) {
    if (body.sex != GetParam()) continue;
    const Eigen::MatrixXf& directions = m.data().directions;
    const Eigen::Vector3f root = (body.rest.cast<double>() * m.data().joint_regressor.row(0).transpose()).cast<float>();
    const fit::Vertices centred = body.rest.colwise() - root;
    const Eigen::VectorXf deviation = centred.reshaped() - m.data().mean.reshaped();
    const Eigen::VectorXf beta = (directions.transpose() * directions).ldlt().solve(directions.transpose() * deviation);
    sum += (deviation - directions * beta).reshaped(3, body.rest.cols()).colwise().norm().mean();
    ++bodies;
  }
  EXPECT_GT(sum / bodies, 1e-4);
  EXPECT_LT(sum / bodies, 8e-3);
}

TEST(TestBodies, AreTheCommittedListInItsOrder) {
  const auto& bodies = test_bodies();
  ASSERT_EQ(bodies.size(), 90u);
  std::vector<int> listed;
  for (fit::Sex sex : {fit::Sex::men, fit::Sex::women})
    for (int id : load_held_out_bodies(kModels / "held_out_bodies.csv", sex)) listed.push_back(id);
  for (std::size_t i = 0; i < 90; ++i) {
    EXPECT_EQ(bodies[i].subject, listed[i]);
    EXPECT_EQ(bodies[i].sex, i < 45 ? fit::Sex::men : fit::Sex::women);
    EXPECT_LT(bodies[i].rest_joints.col(0).norm(), 1e-5);
  }
  const auto one = load_test_body(kModels / "test_bodies.npz", 46);
  EXPECT_EQ(one.subject, bodies[45].subject);
  EXPECT_EQ(one.rest, bodies[45].rest);
  EXPECT_THROW(load_test_body(kModels / "test_bodies.npz", 91), std::runtime_error);
  EXPECT_THROW(load_test_body(kModels / "test_bodies.npz", 0), std::runtime_error);
}

TEST(TestBodies, StoredMeasuresAreThoseOfTheMesh) {
  for (const auto& body : {test_bodies().front(), test_bodies().back()}) {
    const auto measured = fit::named(fit::Measurer(model(body.sex).data()).measure(body.rest, body.rest_joints));
    ASSERT_EQ(measured.size(), body.measurements.size());
    for (std::size_t i = 0; i < measured.size(); ++i) {
      EXPECT_EQ(measured[i].name, body.measurements[i].first);
      EXPECT_NEAR(measured[i].value, body.measurements[i].second, 1e-3 * std::max(1.0, measured[i].value));
    }
  }
}

TEST(CommittedPosePrior, LoadsAndIsSymmetric) {
  const auto p = load_pose_prior(kModels / "pose.npz");
  EXPECT_GE(p.exemplars.cols(), 200);
  fit::PoseVector mean = fit::PoseVector::Zero();
  mean.tail<fit::kPoseDofs>() = p.mean;
  EXPECT_LT((fit::mirror(mean) - mean).norm(), 1e-6);
  int standing = 0, low = 0;
  for (Eigen::Index i = 0; i < p.exemplars.cols(); ++i) {
    EXPECT_EQ(p.exemplars(0, i), 0);
    EXPECT_EQ(p.exemplars(2, i), 0);
    EXPECT_EQ(p.exemplars(4, i), 0);
    standing += p.exemplars(1, i) > 0.85;
    low += p.exemplars(1, i) < 0.65;
  }
  EXPECT_GT(standing, p.exemplars.cols() / 3);
  EXPECT_GE(low, 4);
  const int knee = fit::dof_index("ltibia_rx") - fit::kRootDofs;
  EXPECT_LE(p.lower[knee], -5 * 3.14159 / 180);
  EXPECT_GE(p.upper[knee], 150 * 3.14159 / 180);
}

class ModelFile : public testing::Test {
 protected:
  fs::path folder = fs::temp_directory_path() / ("boothd-model-test-" + std::to_string(::getpid()));
  void SetUp() override { fs::create_directories(folder); }
  void TearDown() override { fs::remove_all(folder); }
};

TEST_F(ModelFile, SavingWhatWasLoadedGivesTheSameModel) {
  BodyModelExtras extras;
  const auto data = load_body_model_data(kModels / "women.npz", &extras);
  save_body_model(folder / "copy.npz", data, extras);
  const auto again = load_body_model_data(folder / "copy.npz");
  EXPECT_EQ(again.mean, data.mean);
  EXPECT_EQ(again.directions, data.directions);
  EXPECT_EQ(again.faces, data.faces);
  EXPECT_EQ(again.landmarks, data.landmarks);
  EXPECT_EQ(again.rest_pose, data.rest_pose);
  EXPECT_EQ(again.version, data.version);
}

TEST_F(ModelFile, PosePriorSurvivesTheRoundTrip) {
  const auto prior = load_pose_prior(kModels / "pose.npz");
  save_pose_prior(folder / "pose.npz", prior);
  const auto again = load_pose_prior(folder / "pose.npz");
  EXPECT_EQ(again.components, prior.components);
  EXPECT_EQ(again.exemplars, prior.exemplars);
  EXPECT_EQ(again.speed_limit, prior.speed_limit);
}

TEST_F(ModelFile, WrongFilesAreRefusedByName) {
  const auto says = [&](auto&& work, const std::string& part) {
    try {
      work();
      ADD_FAILURE() << "expected an error about " << part;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  says([&] { load_body_model(kModels / "pose.npz"); }, "expected 'boothd-body-model'");
  says([&] { load_pose_prior(kModels / "men.npz"); }, "expected 'boothd-pose-prior'");
  says([&] { load_body_model(folder / "missing.npz"); }, "missing.npz");
  std::ofstream(folder / "text.npz") << "this is no archive, only a line of text";
  says([&] { load_body_model(folder / "text.npz"); }, "text.npz");
}

TEST_F(ModelFile, EachWrongArrayIsRefusedWithItsKey) {
  BodyModelExtras extras;
  const auto good = load_body_model_data(kModels / "men.npz", &extras);
  const auto says = [&](const fit::BodyModelData& data, const std::string& part) {
    save_body_model(folder / "bad.npz", data, extras);
    try {
      load_body_model(folder / "bad.npz");
      ADD_FAILURE() << "expected an error about " << part;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find("bad.npz"), std::string::npos) << e.what();
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  auto data = good;
  data.faces(1, 7) = good.mean.cols();
  says(data, "'f'");
  data = good;
  data.mean(0, 3) = std::numeric_limits<float>::quiet_NaN();
  says(data, "'v_template'");
  data = good;
  data.rest_pose[1] = 1;
  says(data, "q_rest");
  data = good;
  data.skin_weight.col(11) *= 3;
  says(data, "'weights'");
  data = good;
  data.joint_regressor *= 2;
  says(data, "J_regressor");
  data = good;
  data.mirror_vertex[0] = -1;
  says(data, "'mirror_vertex'");
}

TEST_F(ModelFile, FindModelsTakesTheExplicitFolderAndSaysWhereItLooked) {
  EXPECT_EQ(find_models(kModels), kModels);
  try {
    find_models(folder);
    ADD_FAILURE() << "an empty folder was accepted";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find(folder.string()), std::string::npos);
  }
}

}  // namespace
}  // namespace booth::daemon
