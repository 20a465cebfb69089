// Body models, the pose prior and the set-aside test bodies as .npz files that numpy.load opens (docs/reference/model-file.md).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::daemon {

/// A body set aside from training: not in the model's shape space. CMU axes (y up, z forward, x left), metres, root joint at the origin.
struct TestBody {
  fit::Sex sex = fit::Sex::men;
  int subject = 0;           ///< ANSUR II subject id
  fit::Vertices rest;        ///< vertices in the A-pose, on the template topology
  fit::Points3 rest_joints;  ///< the true joints (from the base mesh's joint cubes), not regressed ones
  /// Measured on this mesh with fit::measure(): name and value in the unit that fit/body/measure.hpp gives.
  std::vector<std::pair<std::string, double>> measurements;
};

/// What training adds to a model file and only `model info` and the preset `paper` read.
struct BodyModelExtras {
  Eigen::MatrixXd template_regressor;  ///< 24 x V, J_regressor_template: eq. 3 on one template alone
  Eigen::VectorXd sigma;               ///< K; standard deviation of each component over the vertices, metres (norm of the direction)
  Eigen::VectorXd joint_residual;      ///< 24; mean distance of regressed from true joint on the set-aside bodies, metres
  std::string notes;                   ///< how it was made: bodies, seed, command
};

/// Reads a model. Throws std::runtime_error that names the file, the key and the remedy. Thread-safe.
fit::BodyModel load_body_model(const std::filesystem::path& path);
fit::BodyModelData load_body_model_data(const std::filesystem::path& path, BodyModelExtras* extras = nullptr);
/// The same model with joints by eq. 3 as published, from one template alone (preset `paper`).
fit::BodyModel load_body_model_paper(const std::filesystem::path& path);
void save_body_model(const std::filesystem::path& path, const fit::BodyModelData& data, const BodyModelExtras& extras);

fit::PosePrior load_pose_prior(const std::filesystem::path& path);
void save_pose_prior(const std::filesystem::path& path, const fit::PosePrior& prior);

/// `number` counts from 1: 1 to 45 are men, 46 to 90 women. `path` is test_bodies.npz.
TestBody load_test_body(const std::filesystem::path& path, int number);
std::vector<TestBody> load_test_bodies(const std::filesystem::path& path);
void save_test_bodies(const std::filesystem::path& path, const std::vector<TestBody>& bodies);

/// The folder that holds men.npz, women.npz, pose.npz and test_bodies.npz: `explicit_dir` when not empty, else $BOOTHD_MODELS, else
/// /usr/share/boothd/models, else the source tree this was built from. Throws std::runtime_error listing where it looked.
std::filesystem::path find_models(const std::filesystem::path& explicit_dir = {});

}  // namespace booth::daemon
