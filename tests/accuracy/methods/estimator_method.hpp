// The product's own estimator as a method of the study.
#pragma once

#include <memory>

#include "fit/estimator.hpp"
#include "tests/accuracy/booth/errors.hpp"

namespace booth::accuracy {

/// One thread, fixed seed, the models of the preset.
std::unique_ptr<fit::Estimator> make_estimator(const Subjects& subjects, fit::Preset preset, fit::SexChoice sex, fit::EstimatorSettings settings = {});

fit::SexChoice choice_of(fit::Sex sex);

/// The estimator's last result.
FittedBody fitted_body(const fit::Estimator& estimator, const fit::FitResult& result);

/// Where the comparators begin, since none of them finds a person by itself: the A-pose with the true heading, its middle at the cloud's.
fit::PoseVector comparator_start(const fit::BodyModel& model, const fit::Cloud& cloud, double heading);

}  // namespace booth::accuracy
