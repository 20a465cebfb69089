// From configuration to a ready fitter: models loaded, cameras described, everything allocated.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/pipeline/estimator_fitter.hpp"
#include "daemon/record/session_files.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

struct FitSetup {
  SessionModels models;
  std::vector<std::string> versions;  ///< of the models, "men 2026-..." ...
  std::unique_ptr<EstimatorFitter> fitter;
};

struct ReadModels {
  SessionModels bodies;  ///< those that fit.sex wants
  std::shared_ptr<const fit::PosePrior> prior;
  std::vector<std::string> versions;  ///< as FitSetup's
};

/// What models.directory holds of what the configuration wants. Throws std::runtime_error or std::invalid_argument naming the file or the folder.
ReadModels read_models(const Config& config);

/// `open_device` stands in for the CUDA device where it is given. Throws std::runtime_error or std::invalid_argument naming the file or the key.
FitSetup make_fit_setup(const Config& config, const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background,
                        const fit::DeviceOpen& open_device = {});
FitSetup make_fit_setup(const Config& config, const hal::DepthCameras& cameras, const std::vector<hal::DepthFrame>& background,
                        const fit::DeviceOpen& open_device = {});

}  // namespace booth::daemon
