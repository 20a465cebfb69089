// Reads the models that the configuration asks for and builds the fitter around them.
#include "daemon/pipeline/fit_setup.hpp"

#include "daemon/io/model_file.hpp"

namespace booth::daemon {

ReadModels read_models(const Config& config) {
  ReadModels out;
  const auto directory = find_models(config.models.directory);
  const auto load = [&](const char* name) {
    const auto path = directory / (std::string(name) + ".npz");
    auto model = std::make_shared<const fit::BodyModel>(config.fit.preset == "paper" ? load_body_model_paper(path) : load_body_model(path));
    out.versions.push_back(std::string(name) + " " + model->data().version);
    return model;
  };
  if (config.fit.sex != "women") out.bodies.men = load("men");
  if (config.fit.sex != "men") out.bodies.women = load("women");
  out.prior = std::make_shared<const fit::PosePrior>(load_pose_prior(directory / "pose.npz"));
  out.versions.push_back("pose " + out.prior->version);
  return out;
}

FitSetup make_fit_setup(const Config& config, const hal::DepthCameras& cameras, const std::vector<hal::DepthFrame>& background,
                        const fit::DeviceOpen& open_device) {
  std::vector<hal::CameraDescription> descriptions;
  for (const auto& camera : cameras) descriptions.push_back(camera->description());
  return make_fit_setup(config, descriptions, background, open_device);
}

FitSetup make_fit_setup(const Config& config, const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background,
                        const fit::DeviceOpen& open_device) {
  ReadModels models = read_models(config);
  FitSetup out;
  out.models = std::move(models.bodies);
  out.versions = std::move(models.versions);

  fit::CloudSettings cloud;
  cloud.stage_x = static_cast<float>(config.stage.centre_y);  // CMU's x is the booth's y (left), its z the booth's x (forward)
  cloud.stage_z = static_cast<float>(config.stage.centre_x);
  cloud.stage_radius = static_cast<float>(config.stage.radius);
  cloud.stage_height = static_cast<float>(config.stage.height);
  cloud.threads = static_cast<int>(config.fit.threads);
  fit::EstimatorSettings estimator;
  estimator.preset = config.fit.preset == "paper" ? fit::Preset::paper : fit::Preset::booth;
  estimator.sex = config.fit.sex == "men" ? fit::SexChoice::men : config.fit.sex == "women" ? fit::SexChoice::women : fit::SexChoice::automatic;
  estimator.threads = static_cast<int>(config.fit.threads);
  estimator.backend = config.fit.backend == "cuda"   ? fit::BackendChoice::cuda
                      : config.fit.backend == "auto" ? fit::BackendChoice::automatic
                                                     : fit::BackendChoice::cpu;
  if (config.fit.particles > 0) estimator.swarm.particles = estimator.device_particles = static_cast<int>(config.fit.particles);
  estimator.open_device = open_device;
  estimator.seed = static_cast<std::uint64_t>(config.fit.seed);
  out.fitter = std::make_unique<EstimatorFitter>(cameras, background, FitModels{out.models.men, out.models.women, models.prior}, cloud, estimator);
  return out;
}

}  // namespace booth::daemon
