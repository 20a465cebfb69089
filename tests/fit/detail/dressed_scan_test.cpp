// The short form of booth-scan-study: people whom the model does not hold, in clothes and with holes.
#include <gtest/gtest.h>

#include <array>
#include <utility>

#include "daemon/io/model_file.hpp"
#include "fit/body/surface_distance.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "fit/detail/detail_layer.hpp"
#include "fit/estimator.hpp"
#include "tests/support/dressed_person.hpp"

namespace booth::tests {
namespace {

constexpr int kPoints = 30000;

std::unique_ptr<fit::Estimator> estimator(bool clothed) {
  const auto folder = daemon::find_models();
  return std::make_unique<fit::Estimator>(std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "men.npz")),
                                          std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder / "women.npz")),
                                          std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder / "pose.npz")),
                                          fit::EstimatorSettings{.clothed = clothed});
}

fit::Observation observed(const DressedPerson& person, const ScanRequest& request) {
  fit::Observation out(60000);
  fit::CloudReport report;
  EXPECT_TRUE(fit::build_unorganised(scan_of(person, request), Eigen::Matrix3Xf(3, 0), {}, {}, out, report));
  return out;
}

double waist(const fit::BodyModel& model, const fit::ShapeVector& beta) {
  for (const auto& m : fit::measure(model, beta))
    if (m.name == "waist_girth") return m.value;
  return 0;
}

TEST(DressedScan, NormalsPointOutwardsInSpiteOfHoles) {
  const DressedPerson person = dress({.body = 23, .pose = "sit", .seed = 23});
  const fit::Observation scan = observed(person, {.points = kPoints, .holes = 10, .seed = 23});
  fit::SurfaceDistance outer(person.outer_faces, static_cast<int>(person.outer.cols()));
  fit::Vertices normals;
  fit::vertex_normals(person.outer, person.outer_faces, normals);
  outer.set(person.outer, normals);
  int inwards = 0;
  for (int i = 0; i < scan.cloud.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto foot = outer.closest({scan.cloud.x[k], scan.cloud.y[k], scan.cloud.z[k]}, 0.1f, Eigen::Vector3f::Zero(), 0);
    ASSERT_GE(foot.face, 0);
    const Eigen::Vector3f n(scan.cloud.nx[k], scan.cloud.ny[k], scan.cloud.nz[k]);
    inwards += n.dot(normals.col(person.outer_faces(0, foot.face))) < 0;
  }
  EXPECT_LT(inwards, 0.06 * scan.cloud.size);
}

TEST(DressedScan, ABareBodyAndItsDetail) {
  const DressedPerson person = dress({.body = 50, .pose = "arms-up", .heading = 120, .seed = 50});
  const fit::Observation scan = observed(person, {.points = kPoints, .seed = 50});
  const auto fitter = estimator(false);
  const fit::FitResult& result = fitter->fit(scan);
  EXPECT_EQ(result.sex, fit::Sex::women);
  EXPECT_LT(result.cloud_to_model.mean, 0.008);
  fit::DetailLayer layer(fitter->model());
  layer.fit(scan, result.beta, result.q);
  EXPECT_LT(layer.distances(scan.cloud, result.beta, result.q).mean, 0.003);
}

TEST(DressedScan, MeasurementsSayHowWellTheyAreKnown) {
  const auto model = daemon::load_body_model(daemon::find_models() / "men.npz");
  const fit::ShapeVector beta = fit::ShapeVector::Zero(24);
  const auto sharp = fit::measure_with_sd(model, beta, 0.01 * fit::ShapeMatrix::Identity(24, 24));
  const auto vague = fit::measure_with_sd(model, beta, fit::ShapeMatrix::Identity(24, 24));
  const auto nothing = fit::measure_with_sd(model, beta, fit::ShapeMatrix());
  for (std::size_t m = 0; m < sharp.size(); ++m) {
    EXPECT_GT(sharp[m].sd, 0) << sharp[m].name;
    EXPECT_GT(vague[m].sd, sharp[m].sd) << sharp[m].name;
    EXPECT_NEAR(nothing[m].sd, vague[m].sd, 1e-9) << sharp[m].name << ": nothing known is the population's spread";
  }
  EXPECT_NEAR(vague[0].sd, 0.077, 0.03) << "men's statures differ by 7.7 cm";
}

double joint_error(const fit::FitResult& result, const DressedPerson& person, std::string_view joint) {
  return (result.joints.col(fit::joint_index(joint)) - person.joints.col(fit::joint_index(joint))).norm();
}

bool inferred(const fit::FitResult& result, std::string_view joint) {
  return result.visibility[static_cast<std::size_t>(fit::joint_index(joint))] == fit::JointVisibility::inferred;
}

TEST(DressedScan, AMissingForearmIsNotFoldedOntoTheTrunkAndSaysSo) {
  const auto fitter = estimator(false);
  // Nothing is known of a forearm's bend: scans of one person differ by half a radian, which is 12 cm. Folded onto the trunk or the upper arm it was 38 cm off,
  // in the last two of these for the small share of points that it could draw to itself there.
  struct Scan {
    int body;
    std::uint64_t seed;
    double wrist;  ///< m it may be off
  };
  constexpr std::array<Scan, 5> kScans{{{66, 66, 0.10}, {66, 5, 0.20}, {13, 7, 0.20}, {52, 9, 0.20}, {52, 10, 0.20}}};
  double sum = 0;
  for (const auto& [body, seed, wrist] : kScans) {
    SCOPED_TRACE("body " + std::to_string(body) + ", seed " + std::to_string(seed));
    const DressedPerson person = dress({.body = body, .pose = "a", .heading = 120, .seed = seed});
    const fit::Observation scan = observed(person, {.points = kPoints, .missing = bones_missing("rforearm"), .seed = seed});
    const fit::FitResult& result = fitter->fit(scan);
    EXPECT_EQ(result.unseen, bones_missing("rforearm"));
    EXPECT_TRUE(inferred(result, "rwrist"));
    EXPECT_FALSE(inferred(result, "relbow"));
    EXPECT_FALSE(inferred(result, "lwrist"));
    EXPECT_LT(joint_error(result, person, "rwrist"), wrist);
    sum += joint_error(result, person, "rwrist");
    for (const int j : fit::main_joints()) {
      if (j == fit::joint_index("rwrist")) continue;
      EXPECT_LT(joint_error(result, person, fit::bones()[static_cast<std::size_t>(j)].end_joint), 0.04) << j;
    }
  }
  EXPECT_LT(sum / kScans.size(), 0.10);
}

TEST(DressedScan, AMissingLegDoesNotShareThePointsOfTheOther) {
  const DressedPerson person = dress({.body = 13, .pose = "stride", .heading = 160, .seed = 13});
  const fit::Observation scan = observed(person, {.points = kPoints, .missing = bones_missing("rleg"), .seed = 13});
  const auto fitter = estimator(false);
  const fit::FitResult& result = fitter->fit(scan);
  EXPECT_EQ(result.unseen, bones_missing("rleg"));
  EXPECT_TRUE(inferred(result, "rankle"));
  EXPECT_FALSE(inferred(result, "lankle"));
  EXPECT_LT(joint_error(result, person, "lankle"), 0.04);
  EXPECT_LT(joint_error(result, person, "rankle"), 0.40) << "where a standing person may have it";
}

TEST(DressedScan, HalfAPersonIsFoundByTheHead) {
  const auto fitter = estimator(false);
  // In all but the first a leg was folded into the trunk and half of it passed for seen, or the whole body was astray.
  struct Scan {
    int body;
    const char* pose;
    std::uint64_t seed;
  };
  for (const auto& [body, pose, seed] : {Scan{13, "stride", 13}, Scan{13, "stride", 9}, Scan{13, "stride", 23}, Scan{13, "a", 5}, Scan{52, "a", 19}}) {
    SCOPED_TRACE("body " + std::to_string(body) + ", " + pose + ", seed " + std::to_string(seed));
    const DressedPerson person = dress({.body = body, .pose = pose, .heading = 160, .seed = seed});
    const fit::Observation scan = observed(person, {.points = kPoints, .missing = bones_missing("legs"), .seed = seed});
    const fit::FitResult& result = fitter->fit(scan);
    EXPECT_EQ(result.unseen, bones_missing("legs"));
    for (const char* joint : {"head_base", "chest_top", "lelbow", "relbow", "lwrist", "rwrist"}) {
      EXPECT_FALSE(inferred(result, joint)) << joint;
      EXPECT_LT(joint_error(result, person, joint), 0.04) << joint;
    }
  }
}

TEST(DressedScan, ALimbUnderClothesIsWhereItsSleeveIs) {
  const DressedPerson person = dress({.body = 44, .pose = "stride", .heading = 320, .outfit = Outfit::tight, .seed = 44});
  const fit::Observation scan = observed(person, {.points = kPoints, .seed = 44});
  const auto fitter = estimator(true);
  const fit::FitResult& result = fitter->fit(scan);
  EXPECT_EQ(result.unseen, 0u);
  for (const int j : fit::main_joints()) EXPECT_LT(joint_error(result, person, fit::bones()[static_cast<std::size_t>(j)].end_joint), 0.04) << j;
}

TEST(DressedScan, TheBodyUnderLooseClothesIsNotInflated) {
  const auto naked = estimator(false), clothed = estimator(true);
  // A scan's own folds decide about centimetres of its waist: of one person's scans in other clothes one in four is more than 3 cm off.
  constexpr std::array<std::uint64_t, 4> kSeeds{15, 16, 17, 18};
  double sum = 0;
  for (const std::uint64_t seed : kSeeds) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const DressedPerson person = dress({.body = 16, .pose = "a", .heading = 40, .outfit = Outfit::loose, .seed = seed});
    const fit::Observation scan = observed(person, {.points = kPoints, .seed = seed});
    const double truth = person.measures[static_cast<std::size_t>(fit::Measure::waist_girth)];
    const fit::FitResult& plain = naked->fit(scan);
    EXPECT_GT(waist(naked->model(), plain.beta), truth + 0.06) << "without the option the clothes are taken for the body";
    const fit::FitResult& under = clothed->fit(scan);
    sum += std::abs(waist(clothed->model(), under.beta) - truth);
    fit::DetailLayer layer(clothed->model());
    layer.fit(scan, under.beta, under.q);
    EXPECT_LT(layer.distances(scan.cloud, under.beta, under.q).mean, 0.004) << "the clothes are the detail";
  }
  EXPECT_LT(sum / kSeeds.size(), 0.03);
}

}  // namespace
}  // namespace booth::tests
