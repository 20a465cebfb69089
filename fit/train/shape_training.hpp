// From a base body and a survey of people to the two shape models: the whole of `boothctl model train-shape` without its files.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/train/base_body.hpp"
#include "fit/train/person.hpp"
#include "fit/train/template_mesh.hpp"

namespace booth::fit::train {

struct ShapeTrainingSettings {
  std::uint64_t seed = 1;
  int threads = 2;              ///< the result does not depend on it
  double edge_length = 0.0195;  ///< of the template on an average body, metres
  double kept_variance = 0.99;
};

/// People of one sex.
struct Survey {
  std::vector<Person> training, held_out;
  int bodies = 0;                      ///< how many of `training` are drawn
  double stature_sd = 0, mass_sd = 0;  ///< spreads that the database shall have
};

struct HeldOutBody {
  Person person;
  Vertices rest;  ///< root joint at the origin
  Points3 rest_joints;
  MeasureValues measures{};
};

struct TrainedShape {
  BodyModelData model;
  Eigen::MatrixXd template_regressor;  ///< 24 x V
  std::vector<HeldOutBody> held_out;
  Eigen::VectorXd joint_residual;           ///< 24; mean over the held-out bodies, metres
  Eigen::VectorXd template_joint_residual;  ///< the same for template_regressor
  // What the database is like.
  int bodies = 0, rejected = 0;                                                              ///< rejected: drawn, but beyond the sliders' range
  FittedMeasures error_mean = FittedMeasures::Zero(), error_worst = FittedMeasures::Zero();  ///< absolute, of made against wanted measures
  MeasureValues measure_mean{}, measure_sd{};
  double held_out_surface = 0;  ///< mean vertex distance of a held-out body from its projection onto the kept components, metres
};

struct ShapeTraining {
  TemplateMesh mesh;
  TrainedShape men, women;
};

/// `progress` gets lines of text. Throws std::invalid_argument when the base body or a survey does not serve.
ShapeTraining train_shapes(const BaseBody& base, const Survey& men, const Survey& women, const ShapeTrainingSettings& settings,
                           const std::function<void(const std::string&)>& progress);

}  // namespace booth::fit::train
