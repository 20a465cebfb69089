// Where the daemon's frames and units meet the estimator's.
#include "daemon/pipeline/estimator_fitter.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>

namespace booth::daemon {
namespace {

std::vector<fit::Camera> fit_cameras(const std::vector<hal::CameraDescription>& descriptions) {
  std::vector<fit::Camera> out;
  for (const auto& d : descriptions) out.push_back(fit_camera(d));
  return out;
}

/// Durations are measured where the work is done; the pipeline's clock may be a simulated one.
std::int64_t steady_ns() { return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

void copy_result(const fit::FitResult& r, FrameRecord& out) {
  out.person = r.state == fit::FitState::lost ? PersonState::lost : r.state == fit::FitState::estimated ? PersonState::estimated : PersonState::tracked;
  out.sex = r.sex == fit::Sex::men ? RecordSex::men : RecordSex::women;
  out.body_accepted = r.body_accepted;
  std::copy(r.q.data(), r.q.data() + kRecordDofs, out.q.begin());
  out.shape_count = static_cast<std::uint8_t>(std::min<Eigen::Index>(r.beta.size(), kRecordShape));
  std::copy(r.beta.data(), r.beta.data() + out.shape_count, out.beta.begin());
  // Turning axes from CMU (x left, y up, z forward) to booth (x forward, y left, z up) only changes places: 0 1 2 <- 2 0 1.
  constexpr std::array<int, 3> from{2, 0, 1};
  for (std::size_t j = 0; j < kRecordJoints; ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    const Eigen::Quaterniond& g = r.bone_rotation[j];
    const std::array<double, 3> axis{g.x(), g.y(), g.z()};
    int k = 0;
    for (int a = 0; a < 3; ++a) {
      const int ca = from[static_cast<std::size_t>(a)];
      out.joints[j][static_cast<std::size_t>(a)] = r.joints(ca, column);
      out.rotation[j][static_cast<std::size_t>(a)] = static_cast<float>(axis[static_cast<std::size_t>(ca)]);
      for (int b = a; b < 3; ++b)
        out.covariance[j][static_cast<std::size_t>(k++)] = static_cast<float>(r.joint_covariance[j](ca, from[static_cast<std::size_t>(b)]));
    }
    out.rotation[j][3] = static_cast<float>(g.w());
    out.seen[j] = r.visibility[j] == fit::JointVisibility::seen;
  }
  out.residual = static_cast<float>(r.cloud_to_model.mean);
  out.model_to_cloud = static_cast<float>(r.model_to_cloud.mean);
  out.coverage = static_cast<float>(r.coverage);
}

}  // namespace

fit::Camera fit_camera(const hal::CameraDescription& d) {
  fit::Camera out;
  out.width = d.intrinsics.width;
  out.height = d.intrinsics.height;
  out.fx = static_cast<float>(d.intrinsics.fx);
  out.fy = static_cast<float>(d.intrinsics.fy);
  out.cx = static_cast<float>(d.intrinsics.cx);
  out.cy = static_cast<float>(d.intrinsics.cy);
  for (std::size_t i = 0; i < 5; ++i) out.distortion[i] = static_cast<float>(d.intrinsics.distortion[i]);
  out.depth_scale = static_cast<float>(d.depth_scale / (1 + d.depth_gain));
  out.depth_offset = static_cast<float>(-d.depth_offset / (1 + d.depth_gain));
  const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(d.camera_to_world.rotation.data());
  const Eigen::Vector3d translation = Eigen::Map<const Eigen::Vector3d>(d.camera_to_world.translation.data());
  Eigen::Matrix3d booth_from_cmu;
  booth_from_cmu << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  out.rotation = (rotation.transpose() * booth_from_cmu).cast<float>();
  out.translation = (-rotation.transpose() * translation).cast<float>();
  return out;
}

EstimatorFitter::EstimatorFitter(const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background, FitModels models,
                                 const fit::CloudSettings& cloud, const fit::EstimatorSettings& estimator)
    : cameras_(fit_cameras(cameras)),
      builder_(cloud, cameras_),
      observation_(builder_.make_observation(estimator.cloud_capacity)),
      estimator_(models.men, models.women, std::move(models.prior), estimator),
      followed_(cloud) {
  // A model that the estimator does not use serves nobody.
  if (estimator.sex == fit::SexChoice::men) models.women = nullptr;
  if (estimator.sex == fit::SexChoice::women) models.men = nullptr;
  if (cameras_.size() > 1 && cameras_.size() <= kMaxCameras) {
    fit::calibrate::PersonSystemSettings settings;
    settings.cameras = static_cast<int>(cameras_.size());
    settings.pivot = {static_cast<double>(cloud.stage_x), 1.0, static_cast<double>(cloud.stage_z)};
    drift_.emplace(std::move(models.men), std::move(models.women), settings);
  }
  std::vector<bool> have(cameras_.size(), false);
  for (const auto& frame : background) {
    const auto camera = static_cast<std::size_t>(hal::to_int(frame.camera));
    if (camera >= have.size() || have[camera]) continue;
    have[camera] = true;
    builder_.set_background(static_cast<int>(camera), frame.depth);
  }
}

void EstimatorFitter::reset() {
  estimator_.reset();
  followed_.forget();
  if (drift_) drift_->new_person();
  body_accepted_ = false;
  given_up_ = 0;
}

void EstimatorFitter::watch_drift() {
  // A body that is not accepted any more is estimated anew, most likely somebody else's: what is known of the shape is not mixed with the next one's. Whoever
  // is merely out of sight keeps it.
  if (result_->state != fit::FitState::lost) {
    if (body_accepted_ && !result_->body_accepted) {
      ++given_up_;
      if (drift_) drift_->new_person();
    }
    body_accepted_ = result_->body_accepted;
  }
  if (!drift_ || !drift_->observe(observation_, *result_)) return;
  const std::lock_guard lock(drift_mutex_);
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    using Verdict = fit::calibrate::CameraVerdict;
    constexpr double kLateKnown = 0.002;  // s
    const fit::calibrate::CameraDrift& camera = drift_->camera(static_cast<int>(c));
    CameraDriftStatus& said = drift_said_[c];
    said.verdict = camera.verdict == Verdict::unknown  ? CameraDriftStatus::Verdict::unknown
                   : camera.verdict == Verdict::stands ? CameraDriftStatus::Verdict::stands
                   : camera.verdict == Verdict::moved  ? CameraDriftStatus::Verdict::moved
                                                       : CameraDriftStatus::Verdict::blind;
    said.one_of_two = drift_->ambiguous();
    said.displacement = camera.says.displacement;
    said.deviation = camera.says.deviation;
    said.turn = camera.says.step.head<3>().norm();
    said.shift = camera.says.step.tail<3>().norm();
    said.late = camera.says.late;
    said.late_deviation = camera.says.late_deviation;
    said.late_known = camera.says.deviation > 0 && camera.says.late_deviation < kLateKnown;
  }
}

std::vector<CameraDriftStatus> EstimatorFitter::drift() const {
  if (!drift_) return {};
  const std::lock_guard lock(drift_mutex_);
  return {drift_said_.begin(), drift_said_.begin() + static_cast<std::ptrdiff_t>(cameras_.size())};
}

void EstimatorFitter::step(const FitInput& input, FrameRecord& out) {
  const std::int64_t begin = steady_ns();
  std::array<fit::DepthInput, kMaxCameras> inputs;
  std::size_t count = 0;
  for (std::size_t cam = 0; cam < cameras_.size(); ++cam) {
    const hal::DepthFrame* frame = input.frames[cam];
    const auto pixels = static_cast<std::size_t>(cameras_[cam].width) * static_cast<std::size_t>(cameras_[cam].height);
    if (!frame || frame->depth.size() != pixels) continue;
    inputs[count++] = {.camera = static_cast<int>(cam), .depth = frame->depth.data(), .time_offset = hal::seconds(frame->captured - input.reference)};
  }
  observation_.frame = input.frame;
  observation_.time = hal::seconds(input.reference.time_since_epoch());
  const bool somebody = builder_.build({inputs.data(), count}, observation_, report_, followed_.at(observation_.time));
  const std::int64_t built = steady_ns();
  if (followed_.start_over()) estimator_.start_over();
  // Nobody there is an observation too: the estimator has to know that its person is gone.
  const fit::FitResult& result = estimator_.step(observation_);
  result_ = &result;
  const bool told = followed_.remember(result, observation_);
  if (told) watch_drift();
  copy_result(result, out);
  if (!told) out.person = PersonState::lost;
  remark_ = !somebody                             ? fit::describe(report_.outcome)
            : !told                               ? "no single body explains what stands on the stage; parts of it are tried"
            : result.state == fit::FitState::lost ? "the body model does not explain what stands on the stage"
                                                  : "";
  out.points = static_cast<std::uint32_t>(observation_.cloud.size);
  out.others = static_cast<std::uint8_t>(std::clamp(report_.persons - 1, 0, 255));
  out.stage_ns[static_cast<std::size_t>(Stage::cloud)] = built - begin;
  out.stage_ns[static_cast<std::size_t>(Stage::fit)] = steady_ns() - built;
}

BackendStatus EstimatorFitter::backend() const {
  const fit::DeviceReport r = estimator_.device_report();
  if (!r.wanted) return {};
  return {.name = r.name, .problem = r.problem, .losses = r.losses, .changes = r.changes};
}

std::vector<MemoryItem> EstimatorFitter::memory_plan() const {
  std::size_t views = 0;
  for (const auto& view : observation_.views)
    views += view.depth.size() * sizeof(float) + view.label.size() + (view.nearest_dx.size() + view.nearest_dy.size()) * sizeof(std::int16_t);
  const std::size_t cloud = static_cast<std::size_t>(observation_.cloud.capacity()) * (6 * sizeof(float) + 1);
  std::vector<MemoryItem> out{
      {"cloud builder", builder_.memory_bytes()}, {"observation (cloud and views)", cloud + views}, {"estimator", estimator_.memory_bytes()}};
  if (drift_) out.push_back({"drift watch", drift_->memory_bytes()});
  if (const fit::DeviceBytes device = estimator_.device_bytes(); device.device > 0) {
    out.push_back({"pinned for the graphics processor", device.pinned});
    out.push_back({"on the graphics processor", device.device});
  }
  return out;
}

}  // namespace booth::daemon
