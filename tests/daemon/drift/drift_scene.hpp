// A person before four simulated cameras, one of which is knocked at a moment that is known, or stamps its frames late by a time that is known.
#pragma once

#include <array>
#include <functional>
#include <string>

#include "daemon/pipeline/estimator_fitter.hpp"
#include "drivers/synthetic/scene.hpp"
#include "fit/calibrate/rigid.hpp"

namespace booth::tests {

struct DriftScene {
  int body = 1;  ///< test:N
  std::string motion = "walk";
  double seconds = 30;
  int next = -1;       ///< test:N who comes when the first one has gone; negative: nobody
  double gone_at = 0;  ///< seconds; the next one is there half a second later
  std::uint64_t seed = 1;
  drivers::NoiseModel noise{};  ///< Kinect v2
  int cameras = 4;
  int knocked = -1;                                                 ///< which camera; negative: none
  double knocked_at = 0;                                            ///< seconds
  fit::calibrate::Vector6 knock = fit::calibrate::Vector6::Zero();  ///< turn (rad) about the camera's own centre and shift (m), booth frame
  std::array<double, 8> late{};                                     ///< seconds by which a camera's time stamps lie behind its exposures
  std::vector<hal::CameraDescription> told{};                       ///< what the fit is told of the cameras; empty: the truth before the knock
};

struct DriftFrame {
  double time = 0;  ///< seconds since the beginning
  const daemon::EstimatorFitter* fitter = nullptr;
  const daemon::FrameRecord* record = nullptr;
  double milliseconds = 0;  ///< of processor time that the fitter took, its own drift watch included
};

/// Processor time of the calling thread.
double thread_ms();

/// Fits frame after frame on one thread with all models; `each` returns false to end. Throws what the loaders throw.
void play(const DriftScene& scene, const std::function<bool(const DriftFrame&)>& each);

/// A camera that was turned about its own centre and shifted.
hal::CameraDescription moved(hal::CameraDescription camera, const fit::calibrate::Vector6& knock);

/// The models that `play` fits with.
const daemon::FitModels& drift_models();

}  // namespace booth::tests
