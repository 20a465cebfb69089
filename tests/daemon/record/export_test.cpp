// Sessions read back and converted: what an independent reader (assimp) finds in each format, and one sentence for what is broken.
#include <assimp/anim.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <assimp/Importer.hpp>
#include <atomic>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/record/housekeeper.hpp"
#include "daemon/record/retention.hpp"
#include "daemon/record/session_export.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/record/session_reader.hpp"
#include "tests/daemon/record/session_samples.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using tests::read_text;
using tests::sample_frames;
using tests::sample_info;
using tests::sample_models;

struct ExportTest : ::testing::Test {
  tests::TemporaryFolder folder;

  fs::path finished(std::uint64_t count) {
    SessionInfo info = sample_info();
    const fs::path session = create_session_folder(folder.path / "sessions", info);
    info.result = "complete";
    finish_session(session, info, sample_frames(count), sample_models(), nullptr);
    return session;
  }
  std::string complaint(const fs::path& session, ExportFormat format) {
    try {
      export_session(session, format, folder.path / "out", sample_models());
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return {};
  }
};

/// Whether any node below has that name.
const aiNode* find(const aiScene* scene, const char* name) { return scene->mRootNode->FindNode(name); }

TEST_F(ExportTest, AFinishedSessionHasAllItsFiles) {
  const fs::path session = finished(40);
  for (const char* name : {"session.json", "skeleton.csv", "skeleton.bvh", "body.glb", "body.ply", "measurements.json"})
    EXPECT_TRUE(fs::exists(session / name)) << name;
  const auto j = nlohmann::json::parse(read_text(session / "measurements.json"));
  EXPECT_EQ(j["sex"], "men");
  EXPECT_EQ(j["beta"][0], 0.5);
  EXPECT_GT(j["bone_lengths"]["lfemur"].get<double>(), 0.2);
}

TEST_F(ExportTest, EveryFormatIsReadByAnother) {
  const fs::path session = finished(40);
  const auto write = [&](ExportFormat format, const char* name) {
    export_session(session, format, folder.path / name, sample_models());
    return (folder.path / name).string();
  };
  EXPECT_EQ(read_text(write(ExportFormat::csv, "x.csv")), read_text(session / "skeleton.csv")) << "to the last digit";
  for (const auto& [format, name] : {std::pair{ExportFormat::bvh, "x.bvh"}, {ExportFormat::glb, "x.glb"}, {ExportFormat::fbx, "x.fbx"}}) {
    Assimp::Importer importer;
    const aiScene* scene = importer.ReadFile(write(format, name), 0);
    ASSERT_NE(scene, nullptr) << name << ": " << importer.GetErrorString();
    EXPECT_NE(find(scene, "lfemur"), nullptr) << name;
    ASSERT_EQ(scene->mNumAnimations, 1u) << name;
    EXPECT_NEAR(scene->mAnimations[0]->mDuration / scene->mAnimations[0]->mTicksPerSecond, 39 / 30.0, 0.05) << name;
    EXPECT_GE(scene->mAnimations[0]->mNumChannels, 15u) << name << ": the bones that turn by themselves";
    unsigned keys = 0;
    for (unsigned c = 0; c < scene->mAnimations[0]->mNumChannels; ++c) keys = std::max(keys, scene->mAnimations[0]->mChannels[c]->mNumRotationKeys);
    EXPECT_GE(keys, 39u) << name << ": every frame";
    if (format == ExportFormat::bvh) continue;
    ASSERT_GE(scene->mNumMeshes, 1u) << name;
    EXPECT_EQ(scene->mMeshes[0]->mNumFaces, static_cast<unsigned>(sample_models().men->data().faces.cols())) << name;
    EXPECT_GE(scene->mMeshes[0]->mNumBones, 18u) << name;
  }
  Assimp::Importer importer;
  const aiScene* ply = importer.ReadFile(write(ExportFormat::ply, "x.ply"), 0);
  ASSERT_NE(ply, nullptr);
  EXPECT_EQ(ply->mMeshes[0]->mNumFaces, static_cast<unsigned>(sample_models().men->data().faces.cols()));
}

TEST_F(ExportTest, ReadsWhatWasWritten) {
  const auto frames = sample_frames(40);
  const SessionContents read = read_session(finished(40));
  EXPECT_EQ(read.result, "complete");
  ASSERT_EQ(read.frames.size(), 40u);
  for (std::size_t i = 0; i < 40; ++i) {
    for (std::size_t d = 0; d < kRecordDofs; ++d) EXPECT_EQ(static_cast<float>(read.frames[i].q[d]), static_cast<float>(frames[i].q[d]));
    EXPECT_EQ(read.frames[i].captured_utc_ns, frames[i].captured_utc_ns);
    EXPECT_EQ(read.frames[i].person, frames[i].person);
  }
  EXPECT_EQ(read.frames[3].beta[0], 0.5);
}

TEST_F(ExportTest, ARunningOrInterruptedSessionAsFarAsItGoes) {
  const fs::path session = create_session_folder(folder.path, sample_info());
  SessionLog log;
  log.open(session);
  for (const auto& f : sample_frames(25)) log.append(f);
  log.close();
  fs::resize_file(session / kFrameLogName, fs::file_size(session / kFrameLogName) - 100);
  EXPECT_EQ(read_session(session).frames.size(), 24u);
  EXPECT_EQ(complaint(session, ExportFormat::glb), "");
  close_interrupted_sessions(folder.path, sample_models());
  EXPECT_EQ(read_session(session).result, "interrupted");
  EXPECT_EQ(read_session(session).frames.size(), 24u);
  EXPECT_EQ(complaint(session, ExportFormat::bvh), "");
}

TEST_F(ExportTest, OneSentenceForWhatIsBroken) {
  EXPECT_THAT(complaint(folder.path / "nothing", ExportFormat::glb), HasSubstr("there is no such session"));
  const fs::path session = finished(5);
  const std::string csv = read_text(session / "skeleton.csv"), json = read_text(session / "session.json");
  const auto plant = [&](const char* name, const std::string& text) { folder.write("sessions/" + session.filename().string() + "/" + name, text); };
  plant("skeleton.csv", csv.substr(0, csv.size() - 200));
  EXPECT_THAT(complaint(session, ExportFormat::csv), HasSubstr("line 6"));
  std::string bad = csv;
  bad.replace(bad.find(",tracked,"), 9, ",dancing,");
  plant("skeleton.csv", bad);
  EXPECT_THAT(complaint(session, ExportFormat::csv), HasSubstr("line 3 has a state"));
  plant("skeleton.csv", "a,b\n1,2\n");
  EXPECT_THAT(complaint(session, ExportFormat::csv), HasSubstr("first line differs"));
  plant("skeleton.csv", csv);
  bad = json;
  bad.replace(bad.find("\"beta\": ["), 9, "\"beta\": [\"x\",");
  plant("session.json", bad);
  EXPECT_THAT(complaint(session, ExportFormat::glb), HasSubstr("beta[0]"));
  for (const char* text : {"", "{", "[]", "{}", "{\"result\": 3}"}) {
    plant("session.json", text);
    EXPECT_THAT(complaint(session, ExportFormat::glb), HasSubstr("session.json"));
  }
}

TEST_F(ExportTest, WhatIsDeletedIsOverwrittenFirst) {
  // A second name for the same blocks shows what became of them.
  const fs::path file = folder.write("20260101T000000Z-0001-x/secret.txt", "a secret");
  fs::create_hard_link(file, folder.path / "same-blocks");
  EXPECT_EQ(erase_folder(file.parent_path()), "");
  EXPECT_FALSE(fs::exists(file.parent_path()));
  EXPECT_EQ(read_text(folder.path / "same-blocks"), std::string(8, '\0'));
}

TEST_F(ExportTest, RecordingsAreKeptWithinTheirLimits) {
  for (const char* name :
       {"20260101T000000Z-0001-record", "20260102T000000Z-0002-snapshot", "20260103T000000Z-0003-record", "20260104T000000Z-0004-record.partial-abcdef"})
    folder.write(std::string(name) + "/bag_0.db3", std::string(10000, 'x'));
  folder.write("keep/file", "x");
  const std::int64_t day = 86'400'000'000'000, utc = 1'767'225'600'000'000'000;
  const auto in_work = [](const std::string& name) { return name == "20260104T000000Z-0004-record"; };
  EXPECT_EQ(prune_recordings(folder.path, 35000, 0, utc + 4 * day, in_work).size(), 1u);
  EXPECT_EQ(prune_recordings(folder.path, 0, 2, utc + 4 * day + 1, in_work).size(), 1u);
  EXPECT_FALSE(fs::exists(folder.path / "20260102T000000Z-0002-snapshot"));
  EXPECT_TRUE(fs::exists(folder.path / "20260104T000000Z-0004-record.partial-abcdef")) << "one in work";
  EXPECT_TRUE(fs::exists(folder.path / "keep/file"));
  // What could never be finished holds pictures of people, too.
  EXPECT_EQ(prune_recordings(folder.path, 0, 2, utc + 10 * day, [](const std::string&) { return false; }).size(), 2u);
  EXPECT_FALSE(fs::exists(folder.path / "20260104T000000Z-0004-record.partial-abcdef"));
}

TEST(HousekeeperTest, GoesOnAfterAnException) {
  std::atomic<int> turns{0};
  std::mutex mutex;
  std::string said;
  Housekeeper::Settings settings;
  settings.interval = std::chrono::milliseconds(1);
  settings.prune = [&]() -> std::vector<std::string> {
    ++turns;
    throw std::runtime_error("a sector is rotten");
  };
  settings.log = [&](const std::string& line) {
    const std::lock_guard lock(mutex);
    said += line;
  };
  Housekeeper housekeeper(std::move(settings));
  for (int wait = 0; wait < 2000 && turns < 3; ++wait) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_GE(turns, 3);
  const std::lock_guard lock(mutex);
  EXPECT_THAT(said, HasSubstr("a sector is rotten"));
}

TEST(HousekeeperTest, PrunesAtOnceAndWritesOneSnapshotForManyFaults) {
  std::atomic<int> pruned{0}, snapshots{0};
  Housekeeper::Settings settings;
  settings.prune = [&] { return ++pruned, std::vector<std::string>{}; };
  settings.snapshot = [&](const std::string& fault) { return ++snapshots, fault; };
  settings.log = [](const std::string&) {};
  Housekeeper keeper(settings);
  for (int i = 0; i < 5; ++i) keeper.fault("a camera is lost");
  for (int turn = 0; turn < 5000 && (snapshots == 0 || pruned == 0); ++turn) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  for (int i = 0; i < 5; ++i) keeper.fault("and again");
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(pruned, 1);
  EXPECT_EQ(snapshots, 1);
}

}  // namespace
}  // namespace booth::daemon
