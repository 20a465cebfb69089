// A recording of the simulated booth that a calibration is refined by, with the truth beside it.
#pragma once

#include <array>
#include <string>

#include "daemon/calibrate/person_refinement.hpp"

namespace booth::tests {

/// The simulated booth, whose cameras stamp their frames late by so many seconds; the cameras stand where they are told.
daemon::RefinementInput input_of(const std::string& motion, double seconds, const std::array<double, 4>& late);

/// Metres between where a camera has a point of a person on the stage and where it is, at most.
double error_at_stage(const hal::CameraDescription& now, const hal::CameraDescription& truth);

/// Knocks a camera, delays all, refines and compares with the truth. `share`: how much of the knocked camera's error may be left, or be given to another one.
void put_right(const std::string& motion, double seconds, int passes, double share);

}  // namespace booth::tests
