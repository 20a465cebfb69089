// What boothd reads is damaged, and where it writes there is no room.
#include <fmt/format.h>
#include <signal.h>
#include <sys/mount.h>

#include <fstream>

#include "daemon/io/model_file.hpp"
#include "daemon/io/npz.hpp"
#include "daemon/record/session_files.hpp"
#include "daemon/record/session_reader.hpp"
#include "drivers/recording/calibration_checksum.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/synthetic/scene.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/faults/booth.hpp"
#include "tests/faults/changed_files.hpp"
#include "tests/faults/faults.hpp"

namespace booth::tests {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

namespace {

constexpr auto kPatience = std::chrono::seconds(180);
constexpr int kConfigurationWrong = 78, kUnavailable = 69;

struct Judged {
  int refused = 0, taken = 0;
  std::string text() const { return fmt::format("{} refused with a sentence, {} taken for a valid file", refused, taken); }
};

/// Looks at `boothd --check-config` with the damaged file: it may be valid all the same, or has to be refused with its name in a sentence.
void check_config(const fs::path& folder, const fs::path& file, const std::vector<std::string>& options, std::size_t at, FaultRow& row, Judged& judged) {
  std::vector<std::string> command{BOOTH_BINARY_DIR "/bin/boothd", "--check-config"};
  command.insert(command.end(), options.begin(), options.end());
  const Ended ended = run_program(command, folder / "said");
  ++row.times;
  if (ended.status == 0) {
    ++judged.taken;
  } else if (ended.status == kConfigurationWrong || ended.status == kUnavailable) {
    ++judged.refused;
    if (ended.output.find(file.filename().string()) == std::string::npos)
      row.wrong.push_back(fmt::format("{}: byte {}: the complaint does not name the file: {}", file.filename().string(), at, ended.output));
  } else {
    row.wrong.push_back(fmt::format("{}: byte {}: boothd ended with {}: {}", file.filename().string(), at, ended.status, ended.output));
  }
}

/// The same arrays, number for number.
bool same_model(const fs::path& a, const fs::path& b) {
  const daemon::NpzReader one(a), other(b);
  if (one.keys() != other.keys()) return false;
  for (const auto& key : one.keys()) {
    const daemon::NpzArray &x = one.array(key), &y = other.array(key);
    if (x.type != y.type || x.shape != y.shape || x.bytes != y.bytes || x.texts != y.texts) return false;
  }
  return true;
}

}  // namespace

FaultRow configuration_changed(FaultPlan& plan) {
  FaultRow row{.fault = "a byte of the configuration changed, region by region",
               .expected = "refused with file and line (status 78, no further start), or still a valid configuration"};
  const fs::path file = plan.folder / "changed.toml";
  std::ofstream(file) << R"(# A booth as it may stand in a museum.
[booth]
id = "booth-17"

[cameras]
driver = "synthetic"
minimum = 2

[cameras.synthetic]
count = 2
motion = "walk"

[stage]
radius = 1.8
height = 2.4

[fit]
sex = "men"
threads = 1

[session]
quota_bytes = 10_000_000_000
max_age_days = 30
search_seconds = 20

[gpio]
chip = ""

[dds]
enabled = false
)";
  Judged judged;
  with_each_region_changed(file, plan.regions, plan.random, [&](std::size_t at) {
    check_config(plan.folder, file, {"--config", file.string()}, at, row, judged);
  });
  row.seen = judged.text();
  return row;
}

FaultRow model_changed(FaultPlan& plan) {
  FaultRow row{.fault = "a byte of a model file changed, region by region",
               .expected = "refused with the file's name (status 78), or a byte that says nothing of the model, such as a date"};
  const fs::path models = plan.folder / "models", sound = daemon::find_models("");
  fs::create_directories(models);
  for (const char* name : {"men.npz", "women.npz", "pose.npz", "test_bodies.npz"})
    fs::copy_file(sound / name, models / name, fs::copy_options::overwrite_existing);
  Judged judged;
  for (const char* name : {"men.npz", "women.npz", "pose.npz"}) {
    const fs::path file = models / name;
    with_each_region_changed(file, plan.regions, plan.random, [&](std::size_t at) {
      const int before = judged.taken;
      check_config(plan.folder, file, {"--set", "models.directory=" + models.string(), "--set", "dds.enabled=false"}, at, row, judged);
      if (judged.taken > before && !same_model(file, sound / name)) row.wrong.push_back(fmt::format("{}: byte {}: another model is taken", name, at));
    });
  }
  row.seen = judged.text();
  return row;
}

FaultRow calibration_changed(FaultPlan& plan) {
  FaultRow row{.fault = "a byte of the calibration changed, region by region",
               .expected = "refused with file and line; taken only where the byte belongs to the checksum's own line, with the very cameras"};
  const fs::path file = plan.folder / "calibration.toml";
  const auto cameras = drivers::camera_ring(4);
  drivers::write_calibration(file, cameras);
  const std::string sound = drivers::with_checksum(read_text(file));
  // 0: taken, 1: refused with the file's name, 2: refused without it, 3: other cameras; anything else is a crash.
  const auto read = [&] {
    return run_apart([&] {
             try {
               return drivers::calibration_text(drivers::read_calibration(file)) == drivers::calibration_text(cameras) ? 0 : 3;
             } catch (const std::exception& e) {
               return std::string(e.what()).find(file.filename().string()) == std::string::npos ? 2 : 1;
             }
           })
        .status;
  };
  std::ofstream(file) << "nonsense";
  if (read() != 1) row.wrong.push_back("nonsense is taken for a calibration");
  std::ofstream(file) << sound;
  if (read() != 0) row.wrong.push_back("a sound calibration is not read");
  Judged judged;
  with_each_region_changed(file, plan.regions, plan.random, [&](std::size_t at) {
    const int status = read();
    ++row.times;
    if (status == 0)
      ++judged.taken;
    else if (status == 1)
      ++judged.refused;
    else
      row.wrong.push_back(
          fmt::format("byte {}: {}", at, status == 3 ? "other cameras are taken" : fmt::format("reading the calibration ends with {}", status)));
  });
  row.seen = judged.text();
  return row;
}

FaultRow sessions_changed(FaultPlan& plan) {
  FaultRow row{.fault = "a byte of a session's files changed, region by region, before the next start",
               .expected = "the start takes it: other sessions are not touched, and of the damaged one what can be read is kept"};
  // A whole session and one that a power cut has left behind.
  const fs::path folder = plan.folder / "sessions-changed", kept = plan.folder / "kept";
  fs::path complete, running;
  {
    Booth booth(folder, {}, {.restart = std::chrono::hours(1)});
    booth.unit().start();
    std::string why;
    if (!booth.unit().wait_ready(0, kPatience) || !booth.visit(3s, why)) {
      row.wrong.push_back("no session to damage: " + why);
      return row;
    }
    // Beside the session lies what the housekeeper remembers of the clock, and a folder's entries come in any order.
    for (const auto& entry : fs::directory_iterator(booth.sessions()))
      if (entry.is_directory()) complete = entry.path();
    booth.ask("start");
    std::this_thread::sleep_for(3s);
    running = booth.session();
    ::kill(booth.unit().state().pid, SIGKILL);
    eventually([&] { return booth.unit().state().pid < 0; });
  }
  fs::copy(folder / "sessions", kept, fs::copy_options::recursive);
  daemon::SessionModels models{std::make_shared<const fit::BodyModel>(daemon::load_body_model(daemon::find_models("") / "men.npz")), nullptr};
  int readable = 0, unreadable = 0, lost = 0;
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(kept))
    if (entry.is_regular_file()) files.push_back(fs::relative(entry.path(), kept));
  std::sort(files.begin(), files.end());
  const fs::path work = plan.folder / "work";
  for (const fs::path& file : files) {
    with_each_region_changed(kept / file, plan.regions, plan.random, [&](std::size_t at) {
      fs::remove_all(work);
      fs::copy(kept, work, fs::copy_options::recursive);
      const fs::path damaged = work / *file.begin(), other = work / (damaged.filename() == complete.filename() ? running.filename() : complete.filename());
      Ledger ledger;
      ledger.complete(work / complete.filename());
      const std::string place = fmt::format("{}: byte {}", file.string(), at);
      const Ended ended = run_apart([&] { return daemon::close_interrupted_sessions(work, models), 0; });
      ++row.times;
      if (ended.status != 0) row.wrong.push_back(fmt::format("{}: the start ends with {}", place, ended.status));
      if (other.filename() == complete.filename())
        for (const auto& sentence : ledger.check()) row.wrong.push_back(place + ": " + sentence);
      const auto j = nlohmann::json::parse(read_text(other / "session.json"), nullptr, false);
      if (!j.is_object() || j.value("result", "running") == "running") row.wrong.push_back(place + ": the other session was not brought to its end");
      if (damaged.filename() == running.filename() && fs::exists(damaged / ".frames.part")) {
        ++lost;
        row.wrong.push_back(place + ": the frames of an interrupted session lie there and no file is made of them");
      }
      // Whoever reads it later gets it or a sentence.
      const Ended reading = run_apart([&] {
        try {
          daemon::read_session(damaged);
          return 0;
        } catch (const std::exception&) {
          return 1;
        }
      });
      if (reading.status == 0)
        ++readable;
      else if (reading.status == 1)
        ++unreadable;
      else
        row.wrong.push_back(fmt::format("{}: reading the session ends with {}", place, reading.status));
    });
  }
  row.seen = fmt::format("{} of the damaged sessions can be read, {} are refused with a sentence", readable, unreadable);
  return row;
}

FaultRow full_disk(FaultPlan& plan) {
  FaultRow row{.fault = "the disk is full when a session begins, and fills while one runs",
               .expected = "boothd lives on with an alarm, a live session is told as such, and with room again the next is saved"};
  const fs::path folder = plan.folder / "full";
  fs::create_directories(folder / "sessions");
  if (::mount("booth-faults", (folder / "sessions").c_str(), "tmpfs", 0, "size=40m") != 0) {
    row.skipped = "no file system can be mounted here (root is needed)";
    return row;
  }
  const auto fill = [&](std::size_t leave) {
    std::error_code error;
    const auto room = fs::space(folder / "sessions", error).available;
    if (room > leave) std::ofstream(folder / "sessions/filler") << std::string(room - leave, 'x');
  };
  {
    Booth booth(folder);
    booth.unit().start();
    std::string why;
    if (!booth.unit().wait_ready(0, kPatience) || !booth.visit(1s, why)) row.wrong.push_back("no session before the disk is full: " + why);
    const auto starts = booth.unit().state().starts;
    for (const std::size_t leave : {std::size_t{0}, std::size_t{8192}, std::size_t{200'000}}) {
      const auto begin = Unit::Clock::now();
      const auto since = [&] { return std::chrono::duration<double>(Unit::Clock::now() - begin).count(); };
      fill(leave);
      const auto begun = booth.ask("start");
      if (!begun || !begun->value("ok", false)) row.wrong.push_back("with a full disk a session is refused");
      row.ready(since());
      if (!eventually([&] { return booth.whole(); }, kPatience)) row.wrong.push_back("with a full disk the cameras do not run");
      row.whole(since());
      std::this_thread::sleep_for(3s);
      booth.ask("stop");
      if (!booth.becomes("idle", kPatience)) row.wrong.push_back("with a full disk a session does not end");
      const auto status = booth.ask("status");
      if (leave == 0 && (!status || status->value("alarm", "").empty())) row.wrong.push_back("a full disk raises no alarm");
      fs::remove(folder / "sessions/filler");
      if (!booth.visit(2s, why)) row.wrong.push_back("with room again: " + why);
      for (auto& sentence : booth.ledger.check()) row.wrong.push_back(sentence);
      ++row.times;
    }
    if (booth.unit().state().starts != starts) row.wrong.push_back("boothd ended");
    row.seen = fmt::format("{} sessions kept that were complete", booth.ledger.sessions());
    booth.unit().stop();
  }
  ::umount2((folder / "sessions").c_str(), MNT_DETACH);
  return row;
}

const std::vector<Fault>& all_faults() {
  static const std::vector<Fault> out{{"kill", killed},
                                      {"stop", stopped},
                                      {"processor", processor_stolen},
                                      {"memory", memory_limit},
                                      {"disk", full_disk},
                                      {"configuration", configuration_changed},
                                      {"models", model_changed},
                                      {"calibration", calibration_changed},
                                      {"sessions", sessions_changed}};
  return out;
}

}  // namespace booth::tests
