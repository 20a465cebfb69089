// The folder of a session: its beginning, the files written at its end, and what is done with those that never reached it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "daemon/record/session_info.hpp"
#include "daemon/seal/seal.hpp"
#include "fit/body/body_model.hpp"
#include "hal/ground_truth.hpp"

namespace booth::daemon {

/// The models that frames were fitted with; either may be null.
struct SessionModels {
  std::shared_ptr<const fit::BodyModel> men, women;
  const fit::BodyModel* of(RecordSex sex) const { return sex == RecordSex::men ? men.get() : women.get(); }
};

/// "20261122T063323Z-1f2e": sorts by time, unique by chance.
std::string make_session_id(std::int64_t utc_ns);

/// Makes DIRECTORY/ID (mode 0700) with a session.json that says `running`; the folder appears whole or not at all. Creates DIRECTORY where it is missing.
/// With a seal the folder holds its seal.key, and everything that tells of the person is written sealed from then on. Throws std::runtime_error naming the
/// path, the reason and the remedy.
std::filesystem::path create_session_folder(const std::filesystem::path& directory, const SessionInfo& info, const Seal* seal = nullptr);

/// What session.json says of the result; also what `stop --wait` and `track` print.
struct SessionSummary {
  std::uint64_t frames = 0, frames_lost = 0;
  double fps = 0, seconds = 0;
  double residual_mean = 0, residual_p95 = 0;
  bool partial = false;  ///< so little of the body was seen that the rest is inferred (coverage_is_partial)
  double coverage = 0;   ///< part of the surface that points explain, mean over the frames with a person
  bool truth_known = false;
  double joint_mean = 0, joint_p95 = 0, surface_mean = 0;  ///< metres
  std::string json;                                        ///< the whole of session.json
};

/// Writes skeleton.csv, skeleton.bvh, body.ply and at last session.json, each whole or not at all, then removes the raw log. Each file is left out where
/// there is nothing to put in it. `truth` may be null. With a seal all of them are NAME.sealed, and beside session.json.sealed stands a session.json
/// that says what became of the session and nothing of the person. Throws std::runtime_error naming the path and the reason.
SessionSummary finish_session(const std::filesystem::path& folder, const SessionInfo& info, const std::vector<FrameRecord>& frames, const SessionModels& models,
                              const hal::GroundTruth* truth, const Seal* seal = nullptr);

/// Finishes what a power cut or a crash left behind, marked `interrupted`. The frames of a sealed session stay in their sealed log: only `boothctl decrypt`
/// can make files of them. Returns one sentence for each such session; never throws for a broken one.
std::vector<std::string> close_interrupted_sessions(const std::filesystem::path& directory, const SessionModels& models);

/// The files of an interrupted sealed session, made in the clear in the existing folder `out` from the sealed log. `complaint` says how the log ended, where
/// not with its end. Throws std::runtime_error.
SessionSummary finish_sealed_log(const std::filesystem::path& folder, const Seal& seal, const SessionModels& models, const std::filesystem::path& out,
                                 std::string& complaint);

/// Deletes finished sessions, oldest first, that are older than `max_age_days` (0: any age) or with which all sessions take more than `quota_bytes` (0: any
/// size). Returns one sentence for each.
std::vector<std::string> prune_sessions(const std::filesystem::path& directory, std::int64_t quota_bytes, std::int64_t max_age_days, std::int64_t now_utc_ns);

}  // namespace booth::daemon
