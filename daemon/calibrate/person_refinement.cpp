// Each pass follows the person anew with the cameras where the pass before has put them.
#include "daemon/calibrate/person_refinement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "daemon/calibrate/view_collector.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/pipeline/offline_run.hpp"
#include "fit/calibrate/person_system.hpp"

namespace booth::daemon {
namespace {

using fit::calibrate::CameraSays;
using fit::calibrate::PersonSystem;
using fit::calibrate::PersonSystemSettings;
using fit::calibrate::Rigid;
using fit::calibrate::Vector6;

constexpr double kStretch = 2;               // s; every second one is held out
constexpr std::size_t kFewestStretches = 4;  // held out, with a followed person in at least half of their frames
constexpr int kStretchFrames = 15;
constexpr double kLeastMoments = 40;                    // in which a camera must have seen the person
constexpr double kStill = 0.0003, kStillLate = 0.0002;  // m, s: a pass that moves no camera more is the last
constexpr double kKnown = 0.003;                        // m: a place that is known less well is not taken
constexpr double kFarthest = 0.15;                      // m: cameras that are further off are a case for the board
constexpr double kSure = 2;                             // standard deviations by which held-out frames must be better

struct Stretch {
  double residual = 0;
  int frames = 0;
};

struct Pass {
  std::map<int, Stretch> held_out;  ///< by number
  std::vector<CameraSays> says, held_out_says;
  double seconds = 0;
  int followed = 0;
};

std::vector<CameraSays> judged(PersonSystem& system, std::size_t cameras) {
  system.solve();
  return {system.cameras().begin(), system.cameras().begin() + static_cast<std::ptrdiff_t>(cameras)};
}

Pass follow(const RefinementInput& input, const std::vector<hal::CameraDescription>& places, const std::vector<double>& late) {
  DepthSource source = input.open();
  if (source.cameras.size() != places.size())
    throw std::runtime_error(fmt::format("{} has {} cameras, the calibration {}", source.name, source.cameras.size(), places.size()));
  source.cameras = punctual_cameras(std::move(source.cameras), late);
  FitSetup setup = make_fit_setup(input.config, places, source.background);
  PersonSystemSettings settings;
  settings.cameras = static_cast<int>(places.size());
  settings.pivot = {input.config.stage.centre_y, 1.0, input.config.stage.centre_x};
  PersonSystem learnt(setup.models.men, setup.models.women, settings), held(setup.models.men, setup.models.women, settings);
  Pass out;
  double began = -1, last = -1;
  run_offline(source.cameras, 2, *setup.fitter, [&](const FitInput& group, const FrameRecord& record) {
    const double time = hal::seconds(group.reference.time_since_epoch());
    if (began < 0) began = time;
    const int stretch = static_cast<int>((time - began) / kStretch);
    const bool held_out = stretch % 2 == 1;
    PersonSystem& system = held_out ? held : learnt;
    constexpr int kBetween = 20;  // moments after which the points look for their places by the newest estimate
    if (system.observe(setup.fitter->observation(), setup.fitter->result()) && !held_out && ++out.followed % kBetween == 0) learnt.solve();
    const bool tracked = record.person == PersonState::tracked && record.body_accepted != 0;
    if (tracked && last >= 0) out.seconds += std::min(0.1, time - last);
    last = time;
    if (tracked && held_out) {
      out.held_out[stretch].residual += static_cast<double>(record.residual);
      ++out.held_out[stretch].frames;
    }
    return true;
  });
  out.says = judged(learnt, places.size());
  out.held_out_says = judged(held, places.size());
  return out;
}

/// The step of the CMU frame about the pivot, in the booth frame.
Rigid in_booth(const Vector6& step, const Config& config) {
  Eigen::Matrix3d booth_from_cmu;
  booth_from_cmu << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const Eigen::Vector3d pivot(config.stage.centre_x, config.stage.centre_y, 1.0);
  const Eigen::Matrix3d turn = booth_from_cmu * fit::calibrate::rotation_by(step.head<3>()) * booth_from_cmu.transpose();
  return {turn, pivot + booth_from_cmu * step.tail<3>() - turn * pivot};
}

/// Between two places of a camera: what it does to a person on the stage.
Vector6 difference(const hal::CameraDescription& old, const hal::CameraDescription& now, const Config& config) {
  const Rigid change = rigid_of(now.camera_to_world) * rigid_of(old.camera_to_world).inverse();
  const Eigen::AngleAxisd turn(change.rotation);
  const Eigen::Vector3d pivot(config.stage.centre_x, config.stage.centre_y, 1.0);
  Vector6 out;
  out << turn.angle() * turn.axis(), change * pivot - pivot;
  // displacement_of() knows the CMU frame, whose y is up.
  out << Eigen::Vector3d(out[1], out[2], out[0]), Eigen::Vector3d(out[4], out[5], out[3]);
  return out;
}

double most_off(const std::vector<CameraSays>& says) {
  double most = 0;
  for (const CameraSays& s : says) most = std::max(most, s.displacement);
  return most;
}

/// Sums over the stretches that both passes have.
void compare(const Pass& before, const Pass& after, PersonRefinement& out) {
  std::vector<double> gains;
  for (const auto& [number, a] : before.held_out) {
    const auto b = after.held_out.find(number);
    if (b == after.held_out.end() || a.frames < kStretchFrames || b->second.frames < kStretchFrames) continue;
    const double was = a.residual / a.frames, is = b->second.residual / b->second.frames;
    out.residual_before += was;
    out.residual_after += is;
    out.held_out_frames += a.frames;
    gains.push_back(was - is);
  }
  const auto n = static_cast<double>(gains.size());
  if (gains.empty()) return;
  out.residual_before /= n;
  out.residual_after /= n;
  for (const double g : gains) out.gain += g / n;
  double spread = 0;
  for (const double g : gains) spread += (g - out.gain) * (g - out.gain);
  out.gain_deviation = gains.size() > 1 ? std::sqrt(spread / (n - 1) / n) : out.gain;
  if (gains.size() < kFewestStretches) out.held_out_frames = 0;
}

/// Why nothing can be learnt from a pass; empty where something can.
std::string too_little(const RefinementInput& input, const Pass& pass) {
  std::size_t stretches = 0;
  for (const auto& [number, s] : pass.held_out) stretches += s.frames >= kStretchFrames;
  if (stretches < kFewestStretches)
    return fmt::format("a person with a settled body was followed for {:.0f} s; at least 20 s of somebody who walks about and moves the arms are needed",
                       pass.seconds);
  for (std::size_t c = 0; c < pass.says.size(); ++c)
    if (pass.says[c].moments < kLeastMoments) return fmt::format("camera {} saw the person in too few moments to learn its place from", input.cameras[c].name);
  return "";
}

}  // namespace

PersonRefinement refine_from_person(const RefinementInput& input) {
  PersonRefinement out;
  out.cameras = input.cameras;
  out.change.resize(input.cameras.size());
  std::vector<double> late(input.cameras.size(), 0.0);
  const Pass first = follow(input, out.cameras, late);
  out.passes = 1;
  out.seconds = first.seconds;
  out.disagreement_before = out.disagreement_after = most_off(first.held_out_says);
  if (out.sentence = too_little(input, first); !out.sentence.empty()) return out;

  Pass pass = first;
  while (out.passes < input.passes) {
    double moved = 0, shifted = 0;
    for (std::size_t c = 0; c < out.cameras.size(); ++c) {
      const CameraSays& says = pass.says[c];
      out.cameras[c].camera_to_world = transform_of(in_booth(says.step, input.config) * rigid_of(out.cameras[c].camera_to_world));
      late[c] += says.late;
      moved = std::max(moved, says.displacement);
      shifted = std::max(shifted, std::abs(says.late));
    }
    if (input.say) input.say(fmt::format("pass {}: cameras move by {:.1f} mm and {:.1f} ms at most", out.passes, 1e3 * moved, 1e3 * shifted));
    pass = follow(input, out.cameras, late);
    ++out.passes;
    if (out.sentence = too_little(input, pass); !out.sentence.empty()) return out;
    if (moved < kStill && shifted < kStillLate) break;
  }

  double farthest = 0;
  std::string unknown;
  for (std::size_t c = 0; c < out.cameras.size(); ++c) {
    const Vector6 change = difference(input.cameras[c], out.cameras[c], input.config);
    out.change[c] = {.displacement = fit::calibrate::displacement_of(change),
                     .deviation = pass.says[c].deviation,
                     .turn = change.head<3>().norm(),
                     .shift = change.tail<3>().norm(),
                     .late = late[c],
                     .late_deviation = pass.says[c].late_deviation};
    farthest = std::max(farthest, out.change[c].displacement);
    if (pass.says[c].deviation > kKnown) unknown = input.cameras[c].name;
  }
  compare(first, pass, out);
  out.disagreement_after = most_off(pass.held_out_says);
  const std::string figures = fmt::format(
      "points lie {:.2f} mm off the body instead of {:.2f} on {} frames that served no estimate (gain {:.2f} +- {:.2f}), cameras disagree by {:.1f} mm instead "
      "of {:.1f}",
      1e3 * out.residual_after, 1e3 * out.residual_before, out.held_out_frames, 1e3 * out.gain, 1e3 * out.gain_deviation, 1e3 * out.disagreement_after,
      1e3 * out.disagreement_before);
  if (out.held_out_frames == 0) {
    out.sentence = "the person was lost with the refined cameras: nothing can be compared";
  } else if (farthest > kFarthest) {
    out.sentence = fmt::format("a camera would have to move by {:.0f} mm: calibrate with the board", 1e3 * farthest);
  } else if (!unknown.empty()) {
    out.sentence = fmt::format("the motion says too little of where camera {} stands: let the person turn round and move arms and legs", unknown);
  } else if (!(out.gain > kSure * out.gain_deviation) || out.disagreement_after > out.disagreement_before) {
    out.sentence = "not better: " + figures;
  } else {
    out.better = true;
    out.sentence = figures;
  }
  return out;
}

}  // namespace booth::daemon
