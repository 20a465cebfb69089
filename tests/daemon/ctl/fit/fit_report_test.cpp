// fit.json holds what programs rely on, in the input's frame.
#include "daemon/ctl/fit_report.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "daemon/io/model_file.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {
namespace {

struct Fit {
  std::shared_ptr<const fit::BodyModel> model = std::make_shared<const fit::BodyModel>(load_body_model(find_models() / "men.npz"));
  fit::FitResult result;
  FitContext context;

  Fit() {
    result.state = fit::FitState::estimated;
    result.beta = fit::ShapeVector::Zero(3);
    result.beta[1] = 0.5;
    result.q[fit::dof_index("lfemur_rx")] = 0.25;
    fit::Kinematics k;
    fit::forward_kinematics(result.q, model->bone_vectors(result.beta), k);
    result.joints = k.joint;
    for (auto& c : result.joint_covariance) c = Eigen::Vector3d(1e-6, 4e-4, 1e-5).asDiagonal();
    result.visibility[1] = fit::JointVisibility::inferred;
    result.energy.shape = 2;
    result.energy.total = 3;
    result.cloud_to_model = {0.01, 0.008, 0.02};
    result.coverage = 0.93;
    context.preset = "booth";
    context.seed = 7;
    context.files = {"a.ply"};
  }
  nlohmann::json json() const { return nlohmann::json::parse(fit_json(result, *model, context)); }
};

TEST(FitReport, HasEveryKeyThatProgramsRead) {
  const auto j = Fit().json();
  for (const char* key : {"preset", "sex", "seed", "threads", "q", "beta", "joints", "bone_lengths", "measurements", "energy", "iterations", "total_ms",
                          "cloud_to_model", "model_to_cloud", "terms_active", "coverage"})
    EXPECT_TRUE(j.contains(key)) << key;
  EXPECT_EQ(j["q"].size(), 36u);
  EXPECT_EQ(j["q"][24], 0.25);
  EXPECT_EQ(j["beta"].size(), 3u);
  EXPECT_EQ(j["joints"].size(), 24u);
  EXPECT_EQ(j["bone_lengths"].size(), 23u);
  EXPECT_EQ(j["cloud_to_model"]["p95"], 0.02);
  EXPECT_EQ(j["terms_active"], nlohmann::json::array({"shape"}));
  EXPECT_EQ(j["coverage"], "full");
  EXPECT_EQ(j["sex"], "men");
  EXPECT_NEAR(j["joint_sd"]["lknee"].get<double>(), 0.02, 1e-12) << "along the worst direction";
  EXPECT_EQ(j["joint_visibility"]["lhip"], "inferred");
  EXPECT_NEAR(j["measurements"]["stature"]["value"].get<double>(), 1.75, 0.25);
}

TEST(FitReport, GivesJointsInTheAxesOfTheInput) {
  Fit f;
  const Eigen::Vector3d wrist = f.result.joints.col(fit::joint_index("lwrist"));
  const auto booth = f.json()["joints"]["lwrist"].get<std::vector<double>>();
  EXPECT_EQ(booth, (std::vector<double>{wrist.z(), wrist.x(), wrist.y()}));
  f.context.up = UpAxis::y;
  EXPECT_EQ(f.json()["joints"]["lwrist"].get<std::vector<double>>(), (std::vector<double>{wrist.x(), wrist.y(), wrist.z()}));
}

TEST(FitReport, SaysWhenOnlyPartOfTheBodyWasSeen) {
  Fit f;
  f.context.viewpoints = 1;
  EXPECT_EQ(f.json()["coverage"], "partial");
  f.context.viewpoints = 0;
  f.result.coverage = 0.42;
  EXPECT_EQ(f.json()["coverage"], "partial");
}

TEST(FitReport, WarnsOfPoorFitsAndRefusesWhatIsNoPerson) {
  Fit f;
  EXPECT_EQ(refusal(f.result), "");
  EXPECT_TRUE(f.json()["warnings"].empty());
  f.result.cloud_to_model.p95 = 0.07;
  EXPECT_EQ(refusal(f.result), "");
  EXPECT_EQ(f.json()["warnings"].size(), 1u);
  f.result.cloud_to_model.mean = 0.06;
  EXPECT_THAT(refusal(f.result), ::testing::HasSubstr("60 mm from the points"));
  f.result.cloud_to_model.mean = 0.004;
  f.result.coverage = 0.2;
  EXPECT_THAT(refusal(f.result), ::testing::HasSubstr("20 % of the best body"));
  f.result.coverage = 0.9;
  f.result.state = fit::FitState::lost;
  EXPECT_THAT(refusal(f.result), ::testing::HasSubstr("no person in the input"));
}

}  // namespace
}  // namespace booth::daemon
