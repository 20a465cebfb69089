// boothctl calibrate as a person types it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/daemon/calibrate/calibrate_program.hpp"

namespace booth::tests {
namespace {

TEST(CalibrateVerb, PrintsTheBoardAndNamesWhatIsAskedWrongly) {
  const CalibrateProgram p;
  EXPECT_EQ(p.run("--print board.pdf --paper a3").status, 0);
  EXPECT_GT(std::filesystem::file_size(p.path / "board.pdf"), 2000u);
  EXPECT_EQ(p.run("--verify --out c.toml").status, 64);
  const Ran paper = p.run("--print board.pdf --paper a9");
  EXPECT_EQ(paper.status, 64);
  EXPECT_THAT(paper.err, testing::HasSubstr("allowed are a4, a3, a2, a1 and a0"));
  EXPECT_EQ(p.run("--print a.pdf --from b").status, 64);
  const Ran nothing = p.run("--from absent --out c.toml");
  EXPECT_EQ(nothing.status, 1);
  EXPECT_THAT(nothing.err, testing::HasSubstr("absent/calibration.toml"));
}

TEST(CalibrateVerb, ARefusalLeavesTheGoodFileAndSaysWhy) {
  const CalibrateProgram p;
  ASSERT_EQ(p.run("--simulate views --views 2").status, 0);
  std::ofstream(p.path / "c.toml") << "the good one";
  const Ran ran = p.run("--from views --out c.toml --json");
  EXPECT_EQ(ran.status, 1);
  EXPECT_THAT(ran.err, testing::HasSubstr("refused: too few views"));
  EXPECT_THAT(ran.err, testing::HasSubstr("c.toml stays as it was"));
  const auto json = nlohmann::json::parse(ran.out);
  EXPECT_FALSE(json.at("accepted"));
  EXPECT_EQ(json.at("refusal"), "too-few-views");
  std::ifstream in(p.path / "c.toml");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "the good one");
}

TEST(CalibrateVerb, WhateverItMakesOrChangesIsToldAsJson) {
  const CalibrateProgram p;
  const auto json = [&](const std::string& arguments) {
    const Ran ran = p.run(arguments + " --json");
    EXPECT_EQ(ran.status, 0) << ran.err;
    const auto out = nlohmann::json::parse(ran.out, nullptr, false);
    EXPECT_TRUE(out.is_object()) << arguments << ": " << ran.out;
    return out.is_object() ? out : nlohmann::json::object();
  };
  auto said = json("--print board.pdf --paper a3");
  EXPECT_EQ(said["file"], "board.pdf");
  EXPECT_EQ(said["paper"], "a3");
  EXPECT_EQ(said["width_mm"], 420.0);
  said = json("--simulate views --views 2");
  EXPECT_EQ(said["folder"], "views");
  EXPECT_EQ(said["views"], 3) << "and one of the floor";

  std::filesystem::copy_file(BOOTH_SOURCE_DIR "/tests/daemon/state/version-1/calibration.toml", p.path / "c.toml");
  said = json("--confirm --out c.toml");
  EXPECT_EQ(said["ok"], true);
  EXPECT_EQ(said["file"], "c.toml");
  const Ran nothing = p.run("--restore --out c.toml --json");
  EXPECT_EQ(nothing.status, 1);
  EXPECT_EQ(nothing.out, "");
  std::filesystem::copy_file(p.path / "c.toml", p.path / "c.before-20261101T090000Z.toml");
  said = json("--restore --out c.toml");
  EXPECT_EQ(said["ok"], true);
  EXPECT_EQ(said["file"], "c.toml");
  EXPECT_EQ(said["restored"], "c.before-20261101T090000Z.toml");
}

}  // namespace
}  // namespace booth::tests
