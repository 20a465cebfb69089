// Writing, finishing and clearing away session folders.
#include "daemon/record/session_files.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/pipeline/accepted_body.hpp"
#include "daemon/pipeline/coverage.hpp"
#include "daemon/record/retention.hpp"
#include "daemon/record/session_export.hpp"
#include "daemon/record/session_json.hpp"
#include "daemon/record/session_log.hpp"
#include "daemon/record/truth_error.hpp"
#include "daemon/seal/sealed_file.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::tm utc_calendar(std::int64_t utc_ns) {
  const std::time_t s = static_cast<std::time_t>(utc_ns / 1'000'000'000);
  std::tm out{};
  ::gmtime_r(&s, &out);
  return out;
}

std::string iso_time(std::int64_t utc_ns) {
  return utc_ns == 0 ? "" : fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", utc_calendar(utc_ns), utc_ns / 1'000'000 % 1000);
}

constexpr const char* kHeldOut[] = {"corner", "corner_p95", "plane"};  // as `calibration.held_out.*_mm` of the file, in metres

Json calibration_json(const CalibrationUsed& c) {
  if (c.source == CalibrationUsed::Source::unknown) return nullptr;
  if (c.source == CalibrationUsed::Source::layout) return "layout";
  const auto text = [](const std::string& s) { return s.empty() ? Json(nullptr) : Json(s); };
  const auto length = [](double v) { return v >= 0 ? Json(v) : Json(nullptr); };
  return {{"file", c.file},
          {"utc", text(c.utc)},
          {"checksum", text(c.checksum)},
          {"held_out", {{kHeldOut[0], length(c.held_out_corner)}, {kHeldOut[1], length(c.held_out_corner_p95)}, {kHeldOut[2], length(c.held_out_plane)}}}};
}

Json info_json(const SessionInfo& info) {
  Json j;
  j["format"] = kSessionFormat;
  j["id"] = info.id;
  j["booth"] = info.booth;
  j["software"] = info.software;
  j["result"] = info.result;
  j["reason"] = info.reason;
  j["began"] = iso_time(info.began_utc_ns);
  j["began_utc_ns"] = info.began_utc_ns;
  j["ended"] = iso_time(info.ended_utc_ns);
  j["source"] = info.source;
  j["cameras"] = info.cameras;
  j["calibration"] = calibration_json(info.calibration);
  j["preset"] = info.preset;
  j["seed"] = info.seed;
  j["threads"] = info.threads;
  j["models"] = info.models;
  j["events"] = Json::array();
  for (const SessionHappening& e : info.events) j["events"].push_back({{"utc_ns", e.utc_ns}, {"kind", e.kind}, {"source", e.source}, {"text", e.text}});
  if (info.events_left_out > 0) j["events_left_out"] = info.events_left_out;
  return j;
}

double percentile(std::vector<double> values, double p) {
  if (values.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(p * static_cast<double>(values.size()))) - 1;
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

/// Micrometres are fine enough for a person who reads the file.
double metres(double v) { return std::round(v * 1e6) / 1e6; }
double ms(double v) { return std::round(v * 1e3) / 1e3; }

[[noreturn]] void fail(const fs::path& path, const std::string& doing) {
  throw std::runtime_error(
      fmt::format("{}: cannot be {}: {} (is it writable for this user? the key is session.directory)", path.string(), doing, std::strerror(errno)));
}

void make_private_folder(const fs::path& path) {
  if (::mkdir(path.c_str(), 0700) != 0) fail(path, "made");
}

bool looks_like_session(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.size() == 21 && name[8] == 'T' && name[15] == 'Z' && name[16] == '-';
}

std::vector<fs::path> session_folders(const fs::path& directory) {
  std::vector<fs::path> out;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;  // one that cannot be looked at must not hide the others
    if (it->is_directory(ignored) && looks_like_session(it->path())) out.push_back(it->path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// An empty object where it is missing, cannot be read, or is none: all of that is as good as damaged.
Json read_json(const fs::path& path) {
  try {
    Json j = parse_session_json(read_file_bytes(path, kMostSessionJson));
    if (j.is_object()) return j;
  } catch (const std::exception&) {
  }
  return Json::object();
}

/// Folders that this process has made and not finished: nobody else may clear them away, whatever the clock says meanwhile.
class InWork {
 public:
  void begin(const fs::path& folder) {
    const std::lock_guard lock(mutex_);
    folders_.insert(fs::weakly_canonical(folder));
  }
  void end(const fs::path& folder) {
    const std::lock_guard lock(mutex_);
    folders_.erase(fs::weakly_canonical(folder));
  }
  bool holds(const fs::path& folder) {
    const std::lock_guard lock(mutex_);
    return folders_.contains(fs::weakly_canonical(folder));
  }

 private:
  std::mutex mutex_;
  std::set<fs::path> folders_;
};

InWork& in_work() {
  static InWork one;
  return one;
}

std::string text_of(const Json& j, const char* key) { return j.contains(key) && j[key].is_string() ? j[key].get<std::string>() : ""; }

/// What a session.json tells of events; what is not as it was written is passed over.
std::vector<SessionHappening> events_of(const Json& j) {
  std::vector<SessionHappening> out;
  if (!j.contains("events") || !j["events"].is_array()) return out;
  for (const Json& e : j["events"])
    if (e.is_object() && e.contains("utc_ns") && e["utc_ns"].is_number_integer())
      out.push_back({e["utc_ns"].get<std::int64_t>(), text_of(e, "kind"), text_of(e, "source"), text_of(e, "text")});
  return out;
}

/// What a session.json tells of the calibration. One of an older boothd tells nothing, and what is not as it was written is not known.
CalibrationUsed calibration_of(const Json& j) {
  CalibrationUsed out;
  if (!j.contains("calibration")) return out;
  const Json& c = j["calibration"];
  if (c == "layout") out.source = CalibrationUsed::Source::layout;
  if (!c.is_object() || text_of(c, "file").empty()) return out;
  out = {.source = CalibrationUsed::Source::file, .file = text_of(c, "file"), .utc = text_of(c, "utc"), .checksum = text_of(c, "checksum")};
  const auto length = [&](const char* key) {
    const bool said = c.contains("held_out") && c["held_out"].is_object() && c["held_out"].contains(key) && c["held_out"][key].is_number();
    return said ? c["held_out"][key].get<double>() : -1;
  };
  out.held_out_corner = length(kHeldOut[0]);
  out.held_out_corner_p95 = length(kHeldOut[1]);
  out.held_out_plane = length(kHeldOut[2]);
  return out;
}

/// What a write was that never came to its end; its file, where there was one before, is still whole.
void remove_half_files(const fs::path& folder) {
  std::vector<fs::path> halves;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.ends_with(".part") && name != kFrameLogName) halves.push_back(it->path());
  }
  for (const auto& half : halves) fs::remove(half, error);
}

std::string json_file(const Json& j) { return j.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; }

void remove_log(const fs::path& folder) {
  std::error_code ignored;
  fs::remove(folder / kFrameLogName, ignored);
  fs::remove(folder / (std::string(kSealedFrameLogName) + kSealedEnding), ignored);
}

/// What session.json said at the beginning, now that nothing else can be known.
SessionInfo interrupted_info(const fs::path& folder, const Json& old) {
  SessionInfo info;
  info.id = folder.filename().string();
  info.booth = text_of(old, "booth");
  info.software = text_of(old, "software");
  info.source = text_of(old, "source");
  info.preset = text_of(old, "preset");
  if (old.contains("began_utc_ns") && old["began_utc_ns"].is_number_integer()) info.began_utc_ns = old["began_utc_ns"].get<std::int64_t>();
  for (const char* key : {"cameras", "models"}) {
    if (!old.contains(key) || !old[key].is_array()) continue;
    for (const Json& item : old[key]) {
      if (item.is_string()) (std::strcmp(key, "cameras") == 0 ? info.cameras : info.models).push_back(item.get<std::string>());
    }
  }
  info.calibration = calibration_of(old);
  info.events = events_of(old);
  info.result = "interrupted";
  info.reason = "boothd ended before the session did";
  return info;
}

/// Nothing that a person might still make something of is deleted before its time: retention takes it with the folder.
void keep_damaged_log(const fs::path& folder, std::string& said) {
  std::error_code error;
  const fs::path log = folder / kFrameLogName;
  if (!fs::exists(log, error) || fs::file_size(log, error) == 0 || error) return;
  fs::rename(log, folder / kDamagedLogName, error);
  if (!error) said += fmt::format("; it stays as {}", kDamagedLogName);
}

/// What can be said of a sealed session whose boothd is gone, and its key with it: how many records lie whole in its log.
std::string close_sealed(const fs::path& folder, const SessionInfo& info, const std::string& recipient) {
  const std::uint64_t bytes = sealed_plain_bytes(folder / (std::string(kSealedFrameLogName) + kSealedEnding));
  Json j = info_json(info);
  j["frames"] = session_log_records(bytes);
  j["sealed_to"] = recipient;
  try {
    write_file_atomically(folder / "session.json", json_file(j), 0600);
  } catch (const std::exception& e) {
    return fmt::format("session {} was interrupted and cannot be closed: {}", info.id, e.what());
  }
  return fmt::format("session {} was interrupted; it is sealed, and about {} frames of it wait for `boothctl decrypt`", info.id,
                     j["frames"].get<std::uint64_t>());
}

}  // namespace

std::string make_session_id(std::int64_t utc_ns) {
  std::random_device device;
  return fmt::format("{:%Y%m%dT%H%M%SZ}-{:04x}", utc_calendar(utc_ns), device() & 0xffffu);
}

fs::path create_session_folder(const fs::path& directory, const SessionInfo& info, const Seal* seal) {
  std::error_code error;
  fs::create_directories(directory, error);
  const fs::path temporary = directory / ("." + info.id + ".part");
  fs::path folder = directory / info.id;
  make_private_folder(temporary);
  try {
    Json j = info_json(info);
    if (seal) {
      write_file_atomically(temporary / kSealKeyName, seal->key_file(), 0600);
      j["sealed_to"] = seal->recipient();
    }
    write_file_atomically(temporary / "session.json", json_file(j), 0600);
    fs::rename(temporary, folder, error);
    if (error) {
      errno = error.value();
      fail(folder, "made");
    }
    in_work().begin(folder);
  } catch (const std::exception&) {
    fs::remove_all(temporary, error);  // a disk that is full for weeks must not gather these until the next start
    throw;
  }
  // Whoever is told that a session runs finds it again, whatever happens. The folder above may be new, or not ours to open.
  (void)sync_folder(directory.has_parent_path() ? directory.parent_path() : fs::path("."));
  errno = sync_folder(directory);
  if (errno != 0) fail(folder, "brought to the disk");
  return folder;
}

SessionSummary finish_session(const fs::path& folder, const SessionInfo& info, const std::vector<FrameRecord>& frames, const SessionModels& models,
                              const hal::GroundTruth* truth, const Seal* seal) {
  SessionSummary out;
  out.frames = frames.size();
  std::vector<double> residuals;
  const FrameRecord* last_good = nullptr;
  std::uint64_t accepted_at = 0;
  std::size_t viewpoints = 0;  // the most cameras that a frame with a person came from
  AcceptedBody bodies;
  bool accepted = false;
  for (const FrameRecord& f : frames) {
    if (f.person == PersonState::lost) {
      ++out.frames_lost;
      continue;
    }
    residuals.push_back(static_cast<double>(f.residual));
    // Whoever comes by at the end, not known yet, is not whom this session was about.
    if (!last_good || f.body_accepted || !last_good->body_accepted) last_good = &f;
    out.coverage += static_cast<double>(f.coverage);
    viewpoints = std::max<std::size_t>(viewpoints, f.cameras);
    if (bodies.another(f)) {
      accepted = true;
      accepted_at = f.sequence;
    }
  }
  if (frames.size() > 1) {
    out.seconds = 1e-9 * static_cast<double>(frames.back().captured_ns - frames.front().captured_ns);
    if (out.seconds > 0) out.fps = static_cast<double>(frames.size() - 1) / out.seconds;
  }
  for (double r : residuals) out.residual_mean += r / static_cast<double>(residuals.size());
  out.residual_p95 = percentile(residuals, 0.95);
  if (last_good) {
    out.coverage /= static_cast<double>(residuals.size());
    out.partial = coverage_is_partial(out.coverage, viewpoints);
  }

  if (!frames.empty()) export_csv({folder / "skeleton.csv", seal}, frames);
  const fit::BodyModel* model = last_good ? models.of(last_good->sex) : nullptr;
  // Made with another version's model, or rotted: the skeletons are good for themselves.
  const bool other_model = model != nullptr && last_good->shape_count > static_cast<std::uint32_t>(model->shape_count());
  if (model && !other_model) {
    export_bvh({folder / "skeleton.bvh", seal}, frames, *last_good, *model);
    export_glb({folder / "body.glb", seal}, frames, *last_good, *model);
    export_ply({folder / "body.ply", seal}, *last_good, *model, info.id, info.detail);
    export_measurements({folder / "measurements.json", seal}, *last_good, *model);
  }

  Json j = info_json(info);
  j["state_at_end"] = info.state_at_end;
  j["frames"] = out.frames;
  j["frames_lost"] = out.frames_lost;
  j["frames_not_logged"] = info.frames_not_logged;
  j["groups"] = info.groups;
  j["groups_dropped"] = info.groups_dropped;
  j["frames_unmatched"] = info.frames_unmatched;
  j["seconds"] = ms(out.seconds);
  j["fps"] = ms(out.fps);
  if (info.live && info.latency.count > 0) {
    const LatencySummary& l = info.latency;
    j["latency_ms"] = {{"p50", ms(l.p50_ms)}, {"p95", ms(l.p95_ms)}, {"p99", ms(l.p99_ms)}, {"max", ms(l.max_ms)}, {"mean", ms(l.mean_ms)}};
  }
  for (std::size_t s = 0; s < kStages; ++s) {
    if (info.stages[s].count > 0) {
      j["stage_ms"][kStageNames[s]] = {{"p50", ms(info.stages[s].p50_ms)}, {"p99", ms(info.stages[s].p99_ms)}, {"max", ms(info.stages[s].max_ms)}};
    }
  }
  Json outline = j;  // up to here nothing tells of the person
  j["residual"] = {{"mean", metres(out.residual_mean)}, {"p95", metres(out.residual_p95)}};
  if (last_good) {
    j["sex"] = last_good->sex == RecordSex::men ? "men" : "women";
    j["beta"] = std::vector<double>(last_good->beta.begin(), last_good->beta.begin() + last_good->shape_count);
    if (other_model) j["body_problem"] = fmt::format("its {} coefficients are not those of a model with {}", last_good->shape_count, model->shape_count());
    j["body_accepted"] = accepted;
    if (accepted) j["body_accepted_at_frame"] = accepted_at;
    j["coverage"] = coverage_word(out.partial);
    j["coverage_fraction"] = std::round(out.coverage * 1e4) / 1e4;
  }
  if (truth) {
    const TruthError error = truth_error(frames, models, *truth);
    if (error.frames > 0) {
      out.truth_known = true;
      out.joint_mean = error.joint_mean;
      out.joint_p95 = error.joint_p95;
      out.surface_mean = error.surface_mean;
      Json& t = j["truth"];
      t["body"] = truth->body_name();
      t["sex"] = truth->sex();
      t["frames"] = error.frames;
      t["joint_mean"] = metres(error.joint_mean);
      t["joint_p95"] = metres(error.joint_p95);
      t["joint_mean_settled"] = metres(error.joint_mean_settled);
      t["joints"] = Json::array();
      for (const int joint : fit::main_joints()) t["joints"].push_back(fit::bones()[static_cast<std::size_t>(joint)].end_joint);
      t["joint_mean_24"] = metres(error.joint_mean_all);
      for (std::size_t joint = 0; joint < kRecordJoints; ++joint)
        t["per_joint_mean"][std::string(fit::bones()[joint].end_joint)] = metres(error.per_joint_mean[joint]);
      if (error.surface_frames > 0) {
        t["surface_mean"] = metres(error.surface_mean);
        t["fitted_to_truth"] = metres(error.fitted_to_truth);
        t["truth_to_fitted"] = metres(error.truth_to_fitted);
        t["surface_frames"] = error.surface_frames;
      }
    }
  }
  out.json = json_file(j);
  if (seal) {
    write_file_atomically({folder / "session.json", seal}, out.json);
    outline["sealed_to"] = seal->recipient();
  }
  write_file_atomically(folder / "session.json", seal ? json_file(outline) : out.json, 0600);
  remove_log(folder);
  in_work().end(folder);
  return out;
}

std::vector<std::string> close_interrupted_sessions(const fs::path& directory, const SessionModels& models) {
  std::vector<std::string> said;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    std::error_code ignored;
    if (name.starts_with(".") && name.ends_with(".part") && it->is_directory(ignored)) fs::remove_all(it->path(), ignored);
  }
  for (const fs::path& folder : session_folders(directory)) {
    remove_half_files(folder);
    const Json old = read_json(folder / "session.json");
    const std::string result = text_of(old, "result");
    const bool ended = result == "complete" || result == "interrupted";
    // A session.json that was damaged is as good as one that says `running` while the log is there: the log holds the frames.
    const bool log = !is_sealed(folder) && fs::exists(folder / kFrameLogName, error);
    if (ended || (result != "running" && !log)) {
      // Complete, but the power went away before the log did. Of a sealed one that was interrupted the log is all there is.
      if (ended && !(is_sealed(folder) && result == "interrupted")) remove_log(folder);
      continue;
    }
    SessionInfo info = interrupted_info(folder, old);
    if (is_sealed(folder)) {
      said.push_back(close_sealed(folder, info, text_of(old, "sealed_to")));
      continue;
    }
    std::vector<FrameRecord> frames;
    std::string log_problem;
    try {
      std::string damage;
      frames = read_session_log(folder, nullptr, &damage);
      if (!damage.empty()) {
        log_problem = "; " + damage;
        keep_damaged_log(folder, log_problem);
      }
    } catch (const OtherLogVersion& e) {
      said.push_back(fmt::format("session {} was interrupted and is left as it is: {}", info.id, e.what()));
      continue;
    } catch (const LogOutOfReach& e) {
      said.push_back(fmt::format("session {} was interrupted and is left for the next start: {}", info.id, e.what()));
      continue;
    } catch (const std::bad_alloc&) {
      said.push_back(fmt::format("session {} was interrupted and is left for the next start: there is no memory to read its log", info.id));
      continue;
    } catch (const std::exception& e) {
      log_problem = fmt::format("; {}", e.what());
      keep_damaged_log(folder, log_problem);
    }
    if (!frames.empty()) info.ended_utc_ns = frames.back().captured_utc_ns;
    try {
      finish_session(folder, info, frames, models, nullptr);
      said.push_back(fmt::format("session {} was interrupted; {} frames of it were saved{}", info.id, frames.size(), log_problem));
    } catch (const std::exception& e) {
      said.push_back(fmt::format("session {} was interrupted and cannot be closed: {}", info.id, e.what()));
    }
  }
  return said;
}

SessionSummary finish_sealed_log(const fs::path& folder, const Seal& seal, const SessionModels& models, const fs::path& out, std::string& complaint) {
  SessionInfo info = interrupted_info(folder, read_json(folder / "session.json"));
  const std::vector<FrameRecord> frames = read_session_log(folder, &seal, &complaint);
  if (!frames.empty()) info.ended_utc_ns = frames.back().captured_utc_ns;
  return finish_session(out, info, frames, models, nullptr);
}

std::vector<std::string> prune_sessions(const fs::path& directory, std::int64_t quota_bytes, std::int64_t max_age_days, std::int64_t now_utc_ns) {
  const RetentionRule rule{.what = "session",
                           .age_key = "session.max_age_days",
                           .size_key = "session.quota_bytes",
                           .quota_bytes = quota_bytes,
                           .max_age_days = max_age_days,
                           .deletable = [](const fs::path& folder) { return !in_work().holds(folder); }};
  return prune_folders(directory, rule, now_utc_ns);
}

}  // namespace booth::daemon
