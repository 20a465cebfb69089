// A person in motion, seen by four free-running cameras, through the daemon's own way from images to a followed body.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "drivers/synthetic/motion.hpp"
#include "drivers/synthetic/noise.hpp"
#include "tests/accuracy/booth/subjects.hpp"
#include "tests/accuracy/report/plan.hpp"

namespace booth::accuracy {

/// A motion before it is fitted to a body.
struct Clip {
  std::string name;                       ///< of its case in a table
  std::vector<fit::PoseVector> frames{};  ///< recorded, 30 a second; empty: the project's own motion `name`
};

/// The project's own motions, or with `request.data` those set aside there: up to three of a kind and own ones of kinds that are missing; in the short form
/// one of a kind.
std::vector<Clip> held_out_clips(const Request& request);

struct Sighting {
  int frame = 0;
  double time = 0;  ///< seconds since the first frame
  const fit::FitResult* result = nullptr;
  const fit::Estimator* estimator = nullptr;
  double milliseconds = 0;                          ///< of processor time, cloud and fit
  fit::PoseVector truth;                            ///< at the group's reference instant
  std::function<fit::PoseVector(double)> truth_at;  ///< so many seconds after that instant
};

struct MotionSettings {
  double seconds = 4;
  std::uint64_t seed = 1;
  drivers::NoiseModel noise{};  ///< Kinect v2
  unsigned cameras = 0xF;
  double heading = 0;  ///< the whole motion is turned so far
};

/// Follows the subject frame by frame; `each` sees every frame and returns false to end. Throws Interrupted when the person wants to stop.
void follow(const Subjects& subjects, const Subject& subject, const Clip& clip, const MotionSettings& settings,
            const std::function<bool(const Sighting&)>& each);

}  // namespace booth::accuracy
