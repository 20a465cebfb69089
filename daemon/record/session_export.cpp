// What a session looks like as a file of each format.
#include "daemon/record/session_export.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/bvh_file.hpp"
#include "daemon/io/csv_file.hpp"
#include "daemon/io/glb_file.hpp"
#include "daemon/io/mesh_file.hpp"
#include "daemon/record/export/fbx_file.hpp"
#include "daemon/record/session_reader.hpp"
#include "fit/body/measure.hpp"
#include "fit/detail/detail_layer.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

const char* person_name(PersonState s) { return s == PersonState::lost ? "lost" : s == PersonState::estimated ? "estimated" : "tracked"; }

std::vector<SkeletonRow> csv_rows(const std::vector<FrameRecord>& frames) {
  std::vector<SkeletonRow> rows(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const FrameRecord& f = frames[i];
    SkeletonRow& row = rows[i];
    row.time = 1e-9 * static_cast<double>(f.captured_ns - frames.front().captured_ns);
    row.utc_ns = f.captured_utc_ns;
    row.state = person_name(f.person);
    row.residual = static_cast<double>(f.residual);
    row.q = Eigen::Map<const fit::PoseVector>(f.q.data());
    for (std::size_t j = 0; j < kRecordJoints; ++j)
      row.joints.col(static_cast<Eigen::Index>(j)) = fit::cmu_from_booth({f.joints[j][0], f.joints[j][1], f.joints[j][2]});
  }
  return rows;
}

constexpr std::int64_t kLongestMotion = 8 * 3'600'000'000'000;  ///< nanoseconds: twice what a session may last; more would ask for much of the memory

/// The poses at an even rate, as BVH wants them: at each instant the last pose in which the person was seen. Throws where they span more than eight hours.
std::vector<fit::PoseVector> even_poses(const std::vector<FrameRecord>& frames) {
  std::vector<fit::PoseVector> out;
  const auto seen = [](const FrameRecord& f) { return f.person != PersonState::lost; };
  const auto first = std::find_if(frames.begin(), frames.end(), seen);
  if (first == frames.end()) return out;
  const std::int64_t begin = first->captured_ns, end = frames.back().captured_ns;
  if (end - begin > kLongestMotion) throw std::runtime_error("the times of the frames span more than eight hours, which no session lasts");
  const FrameRecord* shown = &*first;
  auto next = first + 1;
  const auto count = static_cast<std::int64_t>(1e-9 * static_cast<double>(end - begin) * kExportRate) + 1;
  for (std::int64_t k = 0; k < count; ++k) {
    const auto until = begin + static_cast<std::int64_t>((static_cast<double>(k) + 0.5) / kExportRate * 1e9);
    for (; next != frames.end() && next->captured_ns <= until; ++next) {
      if (seen(*next)) shown = &*next;
    }
    out.emplace_back(Eigen::Map<const fit::PoseVector>(shown->q.data()));
  }
  return out;
}

fit::ShapeVector beta_of(const FrameRecord& f) { return Eigen::Map<const Eigen::VectorXd>(f.beta.data(), f.shape_count); }
fit::PoseVector pose_of(const FrameRecord& f) { return Eigen::Map<const fit::PoseVector>(f.q.data()); }

}  // namespace

void export_csv(const FileTarget& file, const std::vector<FrameRecord>& frames) { write_skeleton_csv(file, csv_rows(frames)); }

void export_bvh(const FileTarget& file, const std::vector<FrameRecord>& frames, const FrameRecord& last, const fit::BodyModel& model) {
  write_bvh(file, model.bone_vectors(beta_of(last)), even_poses(frames), 1 / kExportRate);
}

void export_glb(const FileTarget& file, const std::vector<FrameRecord>& frames, const FrameRecord& last, const fit::BodyModel& model) {
  fit::Vertices rest;
  model.shaped(beta_of(last), rest);
  const std::vector<fit::PoseVector> motion = even_poses(frames);
  write_glb(file, {.model = model,
                   .rest_vertices = rest,
                   .rest_joints = model.rest_joints(beta_of(last)),
                   .pose = pose_of(last),
                   .motion = motion,
                   .frame_seconds = 1 / kExportRate});
}

void export_ply(const FileTarget& file, const FrameRecord& last, const fit::BodyModel& model, const std::string& session, std::span<const double> detail) {
  const fit::ShapeVector beta = beta_of(last);
  fit::Vertices posed, normals;
  model.shaped(beta, posed);
  if (static_cast<int>(detail.size()) == model.vertex_count())
    fit::displace(posed, model.data().faces, Eigen::Map<const Eigen::VectorXd>(detail.data(), model.vertex_count()), posed);
  model.pose_mesh(posed, model.rest_joints(beta), pose_of(last), posed);
  fit::vertex_normals(posed, model.data().faces, normals);
  write_ply(file, {.points = posed, .normals = &normals, .faces = &model.data().faces}, UpAxis::z, "booth frame, metres; session " + session);
}

void export_measurements(const FileTarget& file, const FrameRecord& last, const fit::BodyModel& model) {
  Json j;
  j["sex"] = last.sex == RecordSex::men ? "men" : "women";
  j["model_version"] = model.data().version;
  j["body_accepted"] = last.body_accepted != 0;
  j["beta"] = std::vector<double>(last.beta.begin(), last.beta.begin() + last.shape_count);
  j["measurements"] = Json::object();
  if (model.data().landmarks.size() > 0)
    for (const fit::Measurement& m : fit::measure(model, beta_of(last)))
      j["measurements"][std::string(m.name)] = {{"value", m.value}, {"sd", nullptr}, {"unit", m.unit}};
  const fit::Points3 bones = model.bone_vectors(beta_of(last));
  for (int b = 1; b < fit::kBones; ++b) j["bone_lengths"][std::string(fit::bones()[static_cast<std::size_t>(b)].name)] = bones.col(b).norm();
  write_file_atomically(file, j.dump(2) + "\n");
}

const FrameRecord* last_seen(const std::vector<FrameRecord>& frames) {
  const auto it = std::find_if(frames.rbegin(), frames.rend(), [](const FrameRecord& f) { return f.person != PersonState::lost; });
  return it == frames.rend() ? nullptr : &*it;
}

std::string export_session(const std::filesystem::path& folder, ExportFormat format, const std::filesystem::path& file, const SessionModels& models,
                           const Seal* seal) {
  const SessionContents session = read_session(folder, seal);
  if (session.frames.empty()) throw std::runtime_error(fmt::format("{}: holds no frame; there is nothing to export", folder.string()));
  if (format == ExportFormat::csv) {
    export_csv(file, session.frames);
    return session.warning;
  }
  const FrameRecord* last = last_seen(session.frames);
  if (!last) throw std::runtime_error(fmt::format("{}: nobody was seen in it; only --format csv can be exported", folder.string()));
  const fit::BodyModel* model = models.of(last->sex);
  if (!model) throw std::runtime_error(fmt::format("{}: its body model (sex {}) is not there", folder.string(), last->sex == RecordSex::men ? "men" : "women"));
  if (last->shape_count > model->shape_count())
    throw std::runtime_error(fmt::format("{}: its body has {} coefficients, the model {}; it was made with another model", folder.string(), last->shape_count,
                                         model->shape_count()));
  switch (format) {
    case ExportFormat::bvh:
      export_bvh(file, session.frames, *last, *model);
      break;
    case ExportFormat::glb:
      export_glb(file, session.frames, *last, *model);
      break;
    case ExportFormat::ply:
      export_ply(file, *last, *model, session.id);
      break;
    case ExportFormat::fbx: {
      const std::filesystem::path glb = file.string() + fmt::format(".{}.glb", ::getpid());
      export_glb(glb, session.frames, *last, *model);
      try {
        convert_glb_to_fbx(glb, file, static_cast<int>(kExportRate));
      } catch (const std::exception&) {
        ::unlink(glb.c_str());
        throw;
      }
      ::unlink(glb.c_str());
      break;
    }
    case ExportFormat::csv:
      break;
  }
  return session.warning;
}

}  // namespace booth::daemon
