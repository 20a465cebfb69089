// Whole sessions that are sealed: nothing in their folder tells of the person, and the key's holder gets the very files that would have been there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "daemon/record/decrypt.hpp"
#include "daemon/record/retention.hpp"
#include "daemon/record/session_export.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/record/session_reader.hpp"
#include "daemon/seal/sealed_file.hpp"
#include "daemon/session/controller.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/record/session_samples.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/complaint.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::complaint;
using tests::read_text;
using tests::sample_frames;
using tests::sample_info;
using tests::sample_models;

struct SealedSession : ::testing::Test {
  tests::TemporaryFolder folder;
  const PrivateKey key = make_private_key();
  SessionInfo info = sample_info();

  /// A session that was sealed while it ran; without `finish` boothd died before its end.
  fs::path session(std::uint64_t count, bool finish, const Seal* seal) {
    info.result = "running";
    const fs::path made = create_session_folder(folder.path / (seal ? "sealed" : "plain"), info, seal);
    SessionLog log;
    log.open(made, seal);
    for (const auto& f : sample_frames(count)) log.append(f);
    log.close();
    info.result = "complete";
    if (finish) finish_session(made, info, read_session_log(made, seal), sample_models(), nullptr, seal);
    return made;
  }
  fs::path sealed(std::uint64_t count, bool finish) { return session(count, finish, Seal::fresh(key.public_half).get()); }
  Decrypted decrypt(const fs::path& what, const std::string& out = "open") {
    return decrypt_session(what, key, folder.path / out, [] { return sample_models(); });
  }
};

TEST_F(SealedSession, NothingTellsOfThePerson) {
  const fs::path made = sealed(40, true);
  for (const auto& file : fs::directory_iterator(made)) {
    const std::string name = file.path().filename().string(), text = read_text(file.path());
    EXPECT_TRUE(name.ends_with(".sealed") || name == "seal.key" || name == "session.json") << name;
    for (const char* word : {"beta", "residual", "lfemur", "HIERARCHY", "glTF", "ply", "men"}) EXPECT_EQ(text.find(word), std::string::npos) << name << word;
  }
  const json outline = json::parse(read_text(made / "session.json"));
  EXPECT_EQ(outline["result"], "complete");
  EXPECT_EQ(outline["frames"], 40);
  EXPECT_EQ(outline["sealed_to"], key.public_half.id());
}

TEST_F(SealedSession, OpenedItIsThePlainOneToTheLastByte) {
  const fs::path made = sealed(40, true), plain = session(40, true, nullptr);
  const Decrypted done = decrypt(made);
  EXPECT_TRUE(done.complaints.empty()) << done.complaints.front();
  EXPECT_EQ(done.files, (std::vector<std::string>{"body.glb", "body.ply", "measurements.json", "session.json", "skeleton.bvh", "skeleton.csv"}));
  for (const auto& name : done.files) EXPECT_EQ(read_text(folder.path / "open" / name), read_text(plain / name)) << name;
  EXPECT_EQ(fs::status(folder.path / "open").permissions() & fs::perms::all, fs::perms::owner_all);
  EXPECT_THAT(complaint([&] { decrypt(made); }), HasSubstr("File exists")) << "nothing is overwritten";
}

TEST_F(SealedSession, IsExportedWithItsKeyAndSaysWhatToDoWithout) {
  const fs::path made = sealed(20, true);
  const auto seal = open_seal(made, key);
  EXPECT_EQ(read_session(made, seal.get()).frames.size(), 20u);
  export_session(made, ExportFormat::bvh, folder.path / "x.bvh", sample_models(), seal.get());
  EXPECT_THAT(read_text(folder.path / "x.bvh"), HasSubstr("HIERARCHY"));
  const std::string said = complaint([&] { read_session(made); });
  EXPECT_THAT(said, HasSubstr("is sealed to key " + key.public_half.id()));
  EXPECT_THAT(said, HasSubstr("boothctl decrypt"));
}

TEST_F(SealedSession, InterruptedItWaitsForTheKey) {
  const fs::path made = sealed(25, false);
  const fs::path log = made / "frames.log.sealed";
  fs::resize_file(log, fs::file_size(log) - 100);  // in the middle of the last record
  const auto said = close_interrupted_sessions(folder.path / "sealed", sample_models());
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], HasSubstr("about 24 frames of it wait for `boothctl decrypt`"));
  EXPECT_TRUE(close_interrupted_sessions(folder.path / "sealed", sample_models()).empty()) << "once is enough";
  const json outline = json::parse(read_text(made / "session.json"));
  EXPECT_EQ(outline["result"], "interrupted");
  EXPECT_EQ(outline["frames"], 24);
  ASSERT_TRUE(fs::exists(log)) << "all there is of it";
  EXPECT_EQ(read_session(made, open_seal(made, key).get()).frames.size(), 24u);
  const Decrypted done = decrypt(made);
  ASSERT_EQ(done.complaints.size(), 1u);
  EXPECT_THAT(done.complaints[0], HasSubstr("ends before its end"));
  const json opened = json::parse(read_text(folder.path / "open" / "session.json"));
  EXPECT_EQ(opened["result"], "interrupted");
  EXPECT_EQ(opened["frames"], 24);
  EXPECT_EQ(opened["sex"], "men");
  EXPECT_EQ(read_session(folder.path / "open").frames.size(), 24u);
}

TEST_F(SealedSession, AChangedFileIsLeftOutAndNamed) {
  const fs::path made = sealed(20, true);
  std::string bytes = read_text(made / "skeleton.csv.sealed");
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  std::ofstream(made / "skeleton.csv.sealed", std::ios::binary) << bytes;
  fs::rename(made / "body.ply.sealed", made / "body.glb.sealed");  // one in the place of another
  const Decrypted done = decrypt(made);
  ASSERT_EQ(done.complaints.size(), 2u);
  EXPECT_THAT(done.complaints[0], HasSubstr("body.glb.sealed: is damaged or was changed"));
  EXPECT_THAT(done.complaints[1], HasSubstr("skeleton.csv.sealed: is damaged or was changed"));
  EXPECT_EQ(done.files, (std::vector<std::string>{"measurements.json", "session.json", "skeleton.bvh"}));
}

TEST_F(SealedSession, TheWrongKeyAndADestroyedOneOpenNothing) {
  const fs::path made = sealed(20, true);
  const PrivateKey other = make_private_key();
  EXPECT_THAT(complaint([&] { decrypt_session(made, other, folder.path / "x", [] { return sample_models(); }); }), HasSubstr("is sealed to key"));
  EXPECT_FALSE(fs::exists(folder.path / "x"));
  // What secure deletion does first; from then on the rest is noise for everybody.
  std::ofstream(made / "seal.key", std::ios::binary) << std::string(128, '\0');
  EXPECT_THAT(complaint([&] { decrypt(made); }), HasSubstr("cannot be read"));
}

TEST_F(SealedSession, DeletionTakesTheKeyFirst) {
  const fs::path made = sealed(5, true);
  folder.write("sealed/" + made.filename().string() + "/a-smaller-file", "x");
  // A second name for the same blocks shows what became of them.
  fs::create_hard_link(made / "seal.key", folder.path / "same-blocks");
  EXPECT_EQ(erase_folder(made), "");
  EXPECT_FALSE(fs::exists(made));
  const std::string left = read_text(folder.path / "same-blocks");
  EXPECT_EQ(left, std::string(left.size(), '\0'));
  EXPECT_EQ(left.size(), 104u);
}

TEST_F(SealedSession, BoothdSealsFromTheFirstFrameOn) {
  drivers::SystemClock clock;
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  for (int i = 0; i < 3; ++i) cameras.push_back(std::make_unique<tests::FakeCamera>("c" + std::to_string(i), clock, i * 8ms, 1'000'000, true));
  ControllerSettings settings;
  settings.session_directory = folder.path / "sealed";
  settings.minimum_cameras = 2;
  settings.models = sample_models();
  settings.seal_to = std::make_shared<const PublicKey>(key.public_half);
  Controller controller(settings, clock);
  Pipeline pipeline(Pipeline::Settings{.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, controller);
  controller.run(pipeline, fitter, nullptr);
  ASSERT_TRUE(controller.request(SessionEvent::start, "test").accepted);
  ASSERT_TRUE(tests::eventually([&] { return controller.status().counters.fitted >= 15; }, 60s));
  const fs::path made = controller.status().session_folder;
  EXPECT_TRUE(fs::exists(made / "frames.log.sealed"));
  EXPECT_FALSE(fs::exists(made / kFrameLogName));
  controller.request(SessionEvent::stop, "test");
  ASSERT_TRUE(tests::eventually([&] { return controller.state() == SessionState::idle; }, 60s));
  EXPECT_EQ(controller.status().alarm, "");
  controller.shutdown("test");
  const Decrypted done = decrypt(made);
  EXPECT_TRUE(done.complaints.empty());
  EXPECT_GE(json::parse(read_text(folder.path / "open" / "session.json"))["frames"].get<int>(), 15);
  EXPECT_GE(read_session(folder.path / "open").frames.size(), 15u);
}

}  // namespace
}  // namespace booth::daemon
