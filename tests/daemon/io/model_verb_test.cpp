// `boothctl model`: what `info` says about the committed files, and the sentences that bad input gets.
#include "daemon/ctl/model_verb.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/io/model_file.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::filesystem::path kModels = std::filesystem::path(BOOTH_SOURCE_DIR) / "fit" / "models";

nlohmann::json info(const std::string& file) {
  std::ostringstream out;
  EXPECT_EQ(run_model_info({kModels / file, true}, out), 0);
  return nlohmann::json::parse(out.str());
}

TEST(ModelInfo, BodyModelNumbersAgreeWithTheFile) {
  for (const std::string sex : {"men", "women"}) {
    const auto said = info(sex + ".npz");
    const auto data = load_body_model_data(kModels / (sex + ".npz"));
    EXPECT_EQ(said.at("sex"), sex);
    EXPECT_EQ(said.at("vertices"), data.mean.cols());
    EXPECT_EQ(said.at("components"), data.directions.cols());
    EXPECT_TRUE(said.at("closed"));
    const int k95 = said.at("components_95"), k99 = said.at("components_99");
    EXPECT_GE(data.explained[k95 - 1], 0.95);
    EXPECT_LT(data.explained[k95 - 2], 0.95);
    EXPECT_GE(data.explained[k99 - 1], 0.99);
    EXPECT_EQ(said.at("explained_15").get<double>(), data.explained[14]);
    EXPECT_GT(said.at("explained_15").get<double>(), 0.9);
    EXPECT_NEAR(said.at("mean_body").at("stature").get<double>(), sex == "men" ? 1.756 : 1.629, 0.02);
  }
}

TEST(ModelInfo, KnowsThePriorAndTheTestBodies) {
  const auto prior = info("pose.npz");
  EXPECT_EQ(prior.at("angles"), 30);
  EXPECT_NEAR(prior.at("components").get<int>(), 18, 3);
  EXPECT_EQ(prior.at("limits").size(), 30u);
  const auto bodies = info("test_bodies.npz");
  EXPECT_EQ(bodies.at("bodies"), 90);
  EXPECT_EQ(bodies.at("men"), 45);
}

TEST(ModelInfo, PlainTextHasTheSameKeys) {
  std::ostringstream out;
  run_model_info({kModels / "men.npz", false}, out);
  for (const char* key : {"version", "components_95", "explained_15", "stature"}) EXPECT_NE(out.str().find(key), std::string::npos) << key;
}

TEST(ModelTraining, MissingDataGetsASentenceThatNamesTheFile) {
  std::ostringstream out;
  TrainShapeOptions options;
  options.makehuman = "/nonexistent/base";
  options.ansur = "/nonexistent/survey";
  options.out = kModels;
  try {
    run_model_train_shape(options, out);
    ADD_FAILURE();
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("/nonexistent/survey"), std::string::npos) << e.what();
  }
  EXPECT_THROW(run_model_train_pose({"/nonexistent", kModels / "never.npz", {}, 1}, out), std::runtime_error);
}

/// What `boothctl model ...` complains of; parsing runs it.
std::string complaint_of(std::vector<std::string> arguments) {
  CLI::App app;
  add_model_verbs(app);
  std::reverse(arguments.begin(), arguments.end());
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& e) {
    return std::string("usage: ") + e.what();
  } catch (const std::exception& e) {
    return e.what();
  }
  return {};
}

TEST(ModelTraining, OneFolderStandsForBoth) {
  const tests::TemporaryFolder folder;
  const std::string data = folder.path.string(), out = kModels.string();
  const auto train = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"model", "train-shape", "--out", out});
    return complaint_of(more);
  };
  EXPECT_THAT(train({data}), AllOf(HasSubstr("usage: "), HasSubstr("has no folder makehuman-cc0 in it")));
  for (const char* name : {"makehuman-cc0", "ansur2", "elsewhere"}) std::filesystem::create_directory(folder.path / name);
  // The folders are empty: what is missed says where it was looked for.
  EXPECT_THAT(train({data}), HasSubstr(data + "/ansur2/ansur2_male_subset.csv"));
  EXPECT_THAT(train({"--makehuman", data + "/makehuman-cc0", "--ansur", data + "/elsewhere"}), HasSubstr(data + "/elsewhere/ansur2_male_subset.csv"));
  EXPECT_THAT(train({}), AllOf(HasSubstr("usage: "), HasSubstr("DIR, or --makehuman and --ansur")));
  EXPECT_THAT(train({"--makehuman", data + "/makehuman-cc0"}), AllOf(HasSubstr("usage: "), HasSubstr("--ansur")));
  EXPECT_THAT(train({data, "--seed", "-1"}), HasSubstr("--seed: Value -1 not in range 0 to 9000000000000000"));
  EXPECT_THAT(train({data, "--ansur", data + "/elsewhere"}), AllOf(HasSubstr("usage: "), HasSubstr("--ansur")));
}

}  // namespace
}  // namespace booth::daemon
