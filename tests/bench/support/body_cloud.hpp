// The committed models and a cloud of a posed body's surface, as dense as four cameras give it: what the tasks about the estimator measure on.
#pragma once

#include "fit/body/body_model.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::bench {

/// `points` points spread evenly over the body's surface, each moved by normal noise (m) along each axis; CMU frame.
fit::Cloud surface_cloud(const fit::BodyModel& model, const fit::ShapeVector& beta, const fit::PoseVector& q, int points, float noise, unsigned seed);

/// The men's model, the prior, a body of middling shape and a pose with bent limbs.
struct Subject {
  fit::BodyModel model;
  fit::PosePrior prior;
  fit::ShapeVector beta;
  fit::PoseVector q;
};
/// Throws std::runtime_error where the models are missing.
Subject load_subject();

}  // namespace booth::bench
