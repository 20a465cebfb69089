// From a session's frames to the files that other programs read: one way for boothd, `track` and `export`.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "daemon/io/atomic_file.hpp"
#include "daemon/pipeline/frame_record.hpp"
#include "daemon/record/session_files.hpp"

namespace booth::daemon {

enum class ExportFormat : std::uint8_t { bvh, glb, fbx, csv, ply };

/// Of glTF, BVH and FBX: poses at an even rate, as their readers want them.
inline constexpr double kExportRate = 30;

/// All functions write files that are whole or not there and throw std::runtime_error naming the path and the reason.
void export_csv(const FileTarget& file, const std::vector<FrameRecord>& frames);
/// `last` is the last frame that showed the person; its body is the session's.
void export_bvh(const FileTarget& file, const std::vector<FrameRecord>& frames, const FrameRecord& last, const fit::BodyModel& model);
void export_glb(const FileTarget& file, const std::vector<FrameRecord>& frames, const FrameRecord& last, const fit::BodyModel& model);
/// `detail`: offsets of the detail layer, one per vertex of the model, metres; of another length: none.
void export_ply(const FileTarget& file, const FrameRecord& last, const fit::BodyModel& model, const std::string& session, std::span<const double> detail = {});
/// measurements.json: name to value, sd (null: not known) and unit; sex, beta, bone lengths, the model's version.
void export_measurements(const FileTarget& file, const FrameRecord& last, const fit::BodyModel& model);

/// nullptr when nobody was ever seen.
const FrameRecord* last_seen(const std::vector<FrameRecord>& frames);

/// Writes the folder's session in that format; a sealed one needs its seal. Throws also when nobody was seen in it and the format needs a body.
/// Returns SessionContents::warning.
std::string export_session(const std::filesystem::path& folder, ExportFormat format, const std::filesystem::path& file, const SessionModels& models,
                           const Seal* seal = nullptr);

}  // namespace booth::daemon
