// What is acknowledged is written down before the fault, and compared after it.
#include "tests/faults/booth.hpp"

#include <fmt/format.h>

#include <fstream>
#include <functional>

#include "daemon/ctl/control_client.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {
/// What a power cut or a kill may cost: boothd promises all but the last second.
constexpr std::uint64_t kLastSecond = 30;
}  // namespace

Ledger::Files Ledger::look(const fs::path& folder) {
  Files out;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    out[it->path().filename().string()] = std::hash<std::string>()(read_text(it->path()));
  return out;
}

void Ledger::complete(const fs::path& folder) { files_[folder] = look(folder); }

void Ledger::struck(const fs::path& folder, std::uint64_t frames) {
  if (!folder.empty()) struck_[folder] = frames;
}

std::vector<std::string> Ledger::check() {
  std::vector<std::string> out;
  for (const auto& [folder, files] : files_)
    if (look(folder) != files) out.push_back(folder.filename().string() + ": files of a session that was complete are missing or changed");
  for (const auto& [folder, frames] : struck_) {
    const std::string id = folder.filename().string();
    const Json j = Json::parse(read_text(folder / "session.json"), nullptr, false);
    if (!j.is_object() || !j.contains("result") || !j.contains("frames")) {
      out.push_back(id + ": was running, and has no session.json that says what became of it");
      continue;
    }
    interrupted_ += j["result"] == "interrupted";
    if (j["result"] != "interrupted" && j["result"] != "complete") out.push_back(fmt::format("{}: is still \"{}\"", id, j["result"].dump()));
    if (j["frames"].get<std::uint64_t>() + kLastSecond < frames)
      out.push_back(fmt::format("{}: {} frames were published and {} were kept, which is more than the last second lost", id, frames, j["frames"].dump()));
    files_[folder] = look(folder);
  }
  struck_.clear();
  return out;
}

std::vector<std::string> booth_command(const fs::path& folder, const std::vector<std::string>& settings) {
  std::vector<std::string> out{BOOTH_BINARY_DIR "/bin/boothd"};
  std::vector<std::string> all{"control.socket=" + (folder / "c.sock").string(),
                               "session.directory=" + (folder / "sessions").string(),
                               "record.directory=" + (folder / "recordings").string(),
                               "record.on_fault=false",
                               "dds.enabled=false",
                               "cameras.synthetic.count=2",
                               "fit.sex=men",
                               "fit.threads=1"};
  all.insert(all.end(), settings.begin(), settings.end());
  for (auto& setting : all) {
    out.push_back("--set");
    out.push_back(std::move(setting));
  }
  return out;
}

Booth::Booth(fs::path folder, std::vector<std::string> settings, UnitRules rules)
    : folder_(std::move(folder)), unit_((fs::create_directories(folder_), booth_command(folder_, settings)), folder_, std::move(rules)) {}

std::optional<Json> Booth::ask(const std::string& request, std::chrono::milliseconds limit) const {
  try {
    daemon::ControlClient client(folder_ / "c.sock");
    return Json::parse(client.ask(Json{{"request", request}}.dump(), limit));
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

std::string Booth::state() const {
  const auto answer = ask("status");
  return answer ? answer->value("state", "") : "";
}

bool Booth::becomes(const std::string& wanted, std::chrono::seconds limit) const {
  return eventually([&] { return state() == wanted; }, limit);
}

bool Booth::whole() const {
  const auto answer = ask("status");
  if (!answer || !answer->contains("cameras") || (*answer)["cameras"].empty()) return false;
  for (const auto& camera : (*answer)["cameras"])
    if (camera.value("state", "") != "running") return false;
  return true;
}

fs::path Booth::session() const {
  const auto answer = ask("status");
  if (!answer || answer->value("state", "idle") == "idle") return {};
  return answer->value("session_folder", "");
}

bool Booth::visit(std::chrono::milliseconds length, std::string& why) {
  const auto begun = ask("start");
  if (!begun || !begun->value("ok", false)) {
    why = "a session is refused: " + (begun ? begun->value("error", "") : "boothd does not answer");
    return false;
  }
  const fs::path folder = session();
  std::this_thread::sleep_for(length);
  if (!ask("stop") || !becomes("idle", 60s)) {
    why = "a session does not end";
    return false;
  }
  const Json j = Json::parse(read_text(folder / "session.json"), nullptr, false);
  if (!j.is_object() || j.value("result", "") != "complete") {
    why = folder.string() + ": a session that was ended is not complete";
    return false;
  }
  ledger.complete(folder);
  return true;
}

}  // namespace booth::tests
