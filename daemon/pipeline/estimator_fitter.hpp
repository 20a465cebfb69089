// The real FrameFitter: depth images through the CloudBuilder to the Estimator, and its result into the booth frame.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "daemon/pipeline/frame_fitter.hpp"
#include "fit/calibrate/drift_watch.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "fit/estimator.hpp"
#include "fit/track/followed_person.hpp"

namespace booth::daemon {

/// The same camera as the estimator sees it: world in the CMU frame, float.
fit::Camera fit_camera(const hal::CameraDescription& description);

struct FitModels {
  std::shared_ptr<const fit::BodyModel> men, women;  ///< either may be null
  std::shared_ptr<const fit::PosePrior> prior;
};

/// Everything is allocated by the constructor. One thread calls at a time.
class EstimatorFitter final : public FrameFitter {
 public:
  /// `background` holds frames of the empty booth, of any camera, any number. Throws std::invalid_argument when cameras, models or settings are wrong.
  EstimatorFitter(const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background, FitModels models,
                  const fit::CloudSettings& cloud, const fit::EstimatorSettings& estimator);

  void reset() override;
  void step(const FitInput& input, FrameRecord& out) override;
  const char* remark() const override { return remark_; }
  std::vector<MemoryItem> memory_plan() const override;
  BackendStatus backend() const override;
  std::vector<CameraDriftStatus> drift() const override;

  /// Of the last step(), for pictures.
  const fit::Observation& observation() const { return observation_; }
  const fit::CloudReport& report() const { return report_; }
  const fit::Estimator& estimator() const { return estimator_; }
  const fit::FitResult& result() const { return *result_; }
  /// Bodies since the last reset() that were given up because somebody else came: so often the drift watch was told.
  int given_up() const { return given_up_; }

 private:
  void watch_drift();

  std::vector<fit::Camera> cameras_;
  fit::CloudBuilder builder_;
  fit::Observation observation_;
  fit::Estimator estimator_;
  fit::FollowedPerson followed_;
  fit::CloudReport report_;
  std::optional<fit::calibrate::DriftWatch> drift_;  ///< none with a single camera
  mutable std::mutex drift_mutex_;                   ///< guards what follows
  std::array<CameraDriftStatus, kMaxCameras> drift_said_{};
  bool body_accepted_ = false;  ///< of the last frame with a person
  int given_up_ = 0;
  const fit::FitResult* result_ = nullptr;  ///< the estimator's, set by the first step()
  const char* remark_ = "";
};

}  // namespace booth::daemon
