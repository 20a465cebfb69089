// boothd and boothctl as a person uses them: recordings of a session, replayed to the same bits, read by strangers' readers; kill -9 in the middle of one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::eventually;
using tests::Program;
using tests::read_text;

struct RecordingProgram : ::testing::Test {
  tests::TemporaryFolder folder;
  const std::string socket = (folder.path / "c.sock").string();
  std::unique_ptr<Program> boothd;
  std::string out, err;
  int starts = 0;

  /// `more`: further key=value.
  void start(bool depth, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words;
    for (const std::string& s :
         {"control.socket=" + socket, "session.directory=" + (folder.path / "sessions").string(), "record.directory=" + (folder.path / "recordings").string(),
          "record.depth=" + std::string(depth ? "true" : "false"), std::string("record.memory_bytes=100000000"), std::string("record.keep_free_bytes=0"),
          std::string("dds.enabled=false"), std::string("cameras.synthetic.count=2")}) {
      words.push_back("--set");
      words.push_back(s);
    }
    for (const auto& s : more) words.insert(words.end(), {"--set", s});
    boothd = std::make_unique<Program>("boothd", words, folder.path / ("boothd-" + std::to_string(++starts)));
    ASSERT_TRUE(eventually([&] { return boothd->err().find("is ready") != std::string::npos; }, 60s)) << boothd->err();
  }
  int ctl(std::vector<std::string> words, const std::string& verb_socket = {}) {
    if (!verb_socket.empty()) words.insert(words.end(), {"--socket", verb_socket});
    Program child("boothctl", words, folder.path / "ctl");
    const int status = child.wait(120s);
    out = child.out(), err = child.err();
    return status;
  }
  /// A recording runs and has frames: a session's first group may hold one that is older than the recording's beginning otherwise.
  bool holds_frames() {
    const json status = ask({{"request", "record_status"}});
    return status["recording"]["running"] == true && status["recording"]["frames"].get<int>() >= 6;
  }
  json ask(const json& request) { return json::parse(ControlClient(socket).ask(request.dump())); }
  /// Makes a recording, and more of them, up to five, where a loaded machine took frames from the recorder, whose thread is nice. `record` gives the path and
  /// leaves a session running.
  template <class F>
  std::vector<fs::path> recordings(F record) {
    std::vector<fs::path> made;
    for (bool whole = false; !whole && made.size() < 5;) {
      const int before = ask({{"request", "record_status"}})["dropped"].get<int>();
      made.push_back(record());
      const json status = ask({{"request", "record_status"}});
      whole = status["dropped"].get<int>() + status["recording"]["missed"].get<int>() == before;
      EXPECT_EQ(ask({{"request", "stop"}})["ok"], true);
      EXPECT_TRUE(eventually([&] { return ask({{"request", "status"}})["state"] == "idle"; }, 60s));
    }
    return made;
  }
  /// Every frame that can be fitted as it was live gives the same bits. The last recording is asked first, because it lost nothing if any did not; "replay"
  /// is of the one in which there are frames enough, and its path is the result.
  fs::path replays_as_live(const std::vector<fs::path>& bags) {
    for (auto bag = bags.rbegin(); bag != bags.rend(); ++bag) {
      const int status = ctl({"track", bag->string(), "--as-live", "--out", (folder.path / "replay").string()});
      if (status != 0 && bags.size() > 1 && err.find("no session begins in it") != std::string::npos) continue;
      EXPECT_EQ(status, 0) << err;
      int identical = 0, all = -1;
      EXPECT_EQ(std::sscanf(err.c_str(), "%d of %d frames have the very bits", &identical, &all), 2) << err;
      EXPECT_EQ(identical, all) << err;
      if (all >= 5) return *bag;
    }
    ADD_FAILURE() << "no recording of " << bags.size() << " has five frames that can be fitted as they were live: " << err;
    return bags.back();
  }
  /// A reader that does not know us; false with the reason where it is not installed.
  bool stranger(const std::string& script, const fs::path& what, std::string& why) {
    const fs::path modules = fs::path(BOOTH_READERS) / "node_modules";
    if (!fs::exists(modules / "gltf-validator") || std::system("node --version > /dev/null 2>&1") != 0) {
      why = "skipped: node or the readers in " + modules.string() + " are not there (toolchain/test installs them where npm is)";
      return false;
    }
    ::setenv("NODE_PATH", modules.c_str(), 1);
    Program child("/usr/bin/env", {"node", BOOTH_SOURCE_DIR "/tests/readers/" + script, what.string()}, folder.path / "node");
    EXPECT_EQ(child.wait(120s), 0) << child.err();
    out = child.out();
    return true;
  }
};

TEST_F(RecordingProgram, IsReplayedToTheSameBitsAndReadByStrangers) {
  start(true);
  const auto bags = recordings([&]() -> fs::path {
    Program recorder("boothctl", {"record", "--depth", "--socket", socket}, folder.path / "record");
    EXPECT_TRUE(eventually([&] { return holds_frames(); }, 30s)) << recorder.err();
    EXPECT_EQ(ask({{"request", "start"}})["ok"], true);
    EXPECT_TRUE(eventually([&] { return ask({{"request", "status"}})["frames"].get<int>() >= 30; }, 100s));
    EXPECT_EQ(ctl({"snapshot", "--json"}, socket), 0) << err;
    EXPECT_GT(json::parse(out)["frames"].get<int>(), 0);
    recorder.signal(SIGINT);
    EXPECT_EQ(recorder.wait(), 0) << recorder.err();
    return recorder.out().substr(0, recorder.out().find('\n'));
  });
  for (const fs::path& bag : bags) EXPECT_TRUE(fs::exists(bag / "metadata.yaml")) << bag;
  EXPECT_EQ(ask({{"request", "status"}})["recorder"]["depth_allowed"], true);
  boothd->signal(SIGTERM);
  EXPECT_EQ(boothd->wait(), 0);

  const fs::path bag = replays_as_live(bags);

  std::string why;
  if (!stranger("read_bag.cjs", bag, why)) GTEST_SKIP() << why;
  const json read = json::parse(out);
  EXPECT_EQ(read["format"], "16UC1; compressedDepth rvl");
  EXPECT_GT(read["images"].get<int>(), 20);
  EXPECT_EQ(read["pixels"], read["images"].get<int>() * 512 * 424);
  const double mean = read["sum"].get<double>() / read["measured"].get<double>();
  EXPECT_GT(mean, 1000) << "millimetres in a room of some metres";
  EXPECT_LT(mean, 5000);
  EXPECT_EQ(read["camera_info"]["width"], 512);
  EXPECT_GE(read["events"].get<int>(), 2);
  EXPECT_TRUE(stranger("validate_glb.cjs", folder.path / "replay" / "body.glb", why));
  EXPECT_EQ(json::parse(out)["errors"], 0);
  EXPECT_EQ(json::parse(out)["animations"], 1);
}

TEST_F(RecordingProgram, SealedItOpensForTheKeyAloneAndIsReplayedToTheSameBits) {
  const std::string base = (folder.path / "booth").string(), key = base + ".private";
  ASSERT_EQ(ctl({"key", "new", base}), 0) << err;
  EXPECT_EQ(ctl({"key", "show", base + ".public"}), 0) << err;
  const std::string shown = out.substr(out.rfind(' ') + 1);
  start(true, {"privacy.seal_to=" + base + ".public"});
  EXPECT_THAT(boothd->err(), HasSubstr("are sealed to key " + shown.substr(0, 16)));
  std::string session;
  const auto bags = recordings([&]() -> fs::path {
    EXPECT_EQ(ask({{"request", "record"}, {"depth", true}, {"seconds", 600}})["ok"], true);
    EXPECT_TRUE(eventually([&] { return holds_frames(); }, 30s));
    EXPECT_EQ(ask({{"request", "start"}})["ok"], true);
    // Who wants the recording to go on, asks.
    EXPECT_TRUE(eventually([&] { return ask({{"request", "record_status"}})["ok"] == true && ask({{"request", "status"}})["frames"].get<int>() >= 30; }, 100s));
    session = ask({{"request", "status"}})["session_folder"];
    EXPECT_EQ(ctl({"snapshot"}, socket), 0) << err;
    EXPECT_EQ(ask({{"request", "record_stop"}})["ok"], true);
    EXPECT_TRUE(eventually([&] { return ask({{"request", "record_status"}})["recording"]["running"] == false; }, 60s));
    return ask({{"request", "record_status"}})["recording"]["path"].get<std::string>();
  });
  const std::string bag = bags.front();
  boothd->signal(SIGTERM);
  EXPECT_EQ(boothd->wait(), 0);
  EXPECT_EQ(boothd->err().find("is refused"), std::string::npos) << "sealing needs a call that boothd's own list does not have: " << boothd->err();
  for (const char* place : {"sessions", "recordings"})
    for (const auto& file : fs::recursive_directory_iterator(folder.path / place)) {
      if (!file.is_regular_file()) continue;
      const std::string text = read_text(file.path());
      for (const char* word : {"depth", "lfemur", "\"beta\"", "SQLite", "HIERARCHY"})
        EXPECT_EQ(text.find(word), std::string::npos) << file.path() << " says " << word;
    }

  // Without the key everybody is told what to do, with it everything is there.
  EXPECT_EQ(ctl({"export", session, "--format", "csv", "--out", (folder.path / "x.csv").string()}), 1);
  EXPECT_THAT(err, HasSubstr("--key FILE"));
  EXPECT_EQ(ctl({"export", session, "--format", "csv", "--key", key, "--out", (folder.path / "x.csv").string()}), 0) << err;
  EXPECT_EQ(ctl({"track", bag, "--out", (folder.path / "t").string()}), 1);
  EXPECT_THAT(err, HasSubstr("boothctl decrypt"));
  EXPECT_EQ(ctl({"decrypt", session, "--key", key, "--json", "--out", (folder.path / "s").string()}), 0) << err;
  EXPECT_EQ(json::parse(out), (json{{"ok", true}, {"folder", (folder.path / "s").string()}, {"complaints", json::array()}}));
  EXPECT_EQ(read_text(folder.path / "s" / "skeleton.csv"), read_text(folder.path / "x.csv"));
  EXPECT_TRUE(json::parse(read_text(folder.path / "s" / "session.json")).contains("beta"));
  std::vector<fs::path> open;
  for (const fs::path& sealed : bags) {
    open.push_back(folder.path / ("b" + std::to_string(open.size())));
    ASSERT_EQ(ctl({"decrypt", sealed.string(), "--key", key, "--out", open.back().string()}), 0) << err;
  }
  EXPECT_EQ(ctl({"decrypt", open.front().string(), "--key", key}), 1);
  EXPECT_THAT(err, HasSubstr("is not sealed"));
  (void)replays_as_live(open);
}

TEST_F(RecordingProgram, AKeyThatIsNotThereMeansNoStart) {
  Program refused("boothd", {"--set", "control.socket=" + socket, "--set", "privacy.seal_to=" + (folder.path / "none.public").string()},
                  folder.path / "refused");
  EXPECT_EQ(refused.wait(), 78);
  EXPECT_THAT(refused.err(), HasSubstr("none.public: the key cannot be read"));
}

TEST_F(RecordingProgram, DepthIsRefusedUnlessConfiguredAndNothingIsWritten) {
  start(false);
  EXPECT_EQ(ctl({"record", "--depth", "--seconds", "1"}, socket), 1);
  EXPECT_THAT(err, HasSubstr("record.depth = true"));
  EXPECT_EQ(ctl({"record", "--seconds", "0.3"}, socket), 0) << err;
  EXPECT_EQ(ctl({"snapshot"}, socket), 0) << err;
  for (const auto& file : fs::recursive_directory_iterator(folder.path / "recordings")) {
    if (!file.is_regular_file()) continue;
    EXPECT_EQ(read_text(file.path()).find("/depth/image_raw"), std::string::npos) << file.path();
  }
  EXPECT_EQ(ask({{"request", "record"}, {"seconds", -1}})["ok"], false);
  EXPECT_EQ(ask({{"request", "record"}, {"seconds", "x"}})["ok"], false);
}

TEST_F(RecordingProgram, KilledInTheMiddleOfARecording) {
  start(true);
  EXPECT_EQ(ask({{"request", "record"}, {"depth", true}, {"seconds", 600}})["ok"], true);
  // Enough of both cameras even where a loaded machine gives them few frames.
  ASSERT_TRUE(eventually(
      [&] {
        const json recording = ask({{"request", "record_status"}})["recording"];
        return recording["seconds"].get<double>() > 2.5 && recording["frames"].get<int>() >= 60;
      },
      60s));
  boothd->signal(SIGKILL);
  boothd->wait();
  boothd.reset();
  start(true);
  EXPECT_THAT(boothd->err(), HasSubstr("was interrupted;"));
  int bags = 0;
  for (const auto& entry : fs::directory_iterator(folder.path / "recordings")) {
    if (!entry.is_directory()) continue;  // the housekeeper's note of the time
    ++bags;
    EXPECT_EQ(entry.path().string().find(".partial-"), std::string::npos);
    EXPECT_EQ(ctl({"track", entry.path().string(), "--out", (folder.path / "t").string()}), 0) << err;
  }
  EXPECT_EQ(bags, 1);
}

}  // namespace
}  // namespace booth::daemon
