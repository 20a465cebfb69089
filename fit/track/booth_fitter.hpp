// Preset `booth` for one body model: start from nothing, follow from frame to frame, and learn the person's shape on the way.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "fit/refine/refiner.hpp"
#include "fit/swarm/start_search.hpp"
#include "fit/track/fit_parts.hpp"

namespace booth::fit {

struct Solution {
  PoseVector q = PoseVector::Zero();
  ShapeVector beta;
  RefineReport report;
  int iterations = 0;
  bool found = false;
  BoneSet unseen = 0;  ///< bones of which the cloud shows nothing; the priors put them where they are
};

/// Allocates in the constructor only. One thread calls at a time.
class BoothFitter {
 public:
  BoothFitter(const BodyModel& model, const PosePrior& prior, WorkerPool& pool, const FitParts& parts = {});

  /// Points outside the body are taken for clothes and weigh little; those inside weigh as ever. Before anything is fitted.
  void set_clothed(double weight) { clothed_ = weight; }
  /// Forgets pose, motion and shape.
  void reset();
  /// Forgets pose and motion; the shape that was learnt stays.
  void lose();
  /// What was learnt of the body, so that it can be put aside while another one is tried.
  struct Learnt {
    ShapeBelief belief;
    ShapeVector beta;
    int frames = 0;
  };
  Learnt learnt() const { return {belief_, beta_, shape_frames_}; }
  void remember(const Learnt& learnt);
  /// The body explains what is seen, so that no other need be tried.
  static bool convincing(const RefineReport& report);

  /// From nothing, in at most `heats` races of candidates (one or two). `other_model`, another fitter or null, is asked as well whether a race has
  /// found the person, who may be of the other sex. Does not change what is remembered: see adopt().
  Solution start(const Observation& observation, BoothFitter* other_model, int heats = 2);
  /// From the given poses: the best after a first refinement gets the full one.
  Solution start_from(const Observation& observation, std::span<const PoseVector> poses);
  /// The poses that the last start() or start_from() refined with some shape, best first: where another model may start.
  std::span<const PoseVector> finalists() const { return {finalists_.data(), static_cast<std::size_t>(finalist_count_)}; }
  /// Takes a solution as the person's state at the observation's time.
  void adopt(const Observation& observation, const Solution& solution);
  /// The next frame from the remembered state. Remembers the result if it was found. A limb that was lost is looked for; a body that goes on
  /// failing to explain the cloud is given up for a fresh start.
  Solution track(const Observation& observation);

  /// Refiner that made the last solution: its poser stands at it.
  const Refiner& refiner() const { return fine_; }
  /// What all frames so far say of the shape, the population's spread included.
  const UnknownMatrix& shape_information() const { return belief_.information; }
  const ShapeBelief& shape_belief() const { return belief_; }
  /// The shape has been learnt from enough frames.
  bool shape_settled() const { return shape_frames_ >= kSettledFrames; }
  const BodyModel& model() const { return model_; }
  std::size_t memory_bytes() const;

 private:
  static constexpr int kSettledFrames = 20;
  void prepare_schedules(const Observation& observation);
  /// Nothing is left that a limb in the wrong place would leave.
  static bool sure(const RefineReport& report);
  /// Each from its q, with the shape that is known; sorted by what they leave.
  void refine_all(Refiner& refiner, const RefineSchedule& schedule, const ShapeBelief& belief, const Observation& observation, std::span<Solution> all);
  /// Moves the best `most` poses that differ from each other to the front; returns how many.
  static std::size_t keep_different(std::span<Solution> sorted, std::size_t most);
  /// Rough refinements of all, finer ones of the best, one with some shape of the last few. The winner has coarse_'s coefficients.
  Solution race(const Observation& observation, std::span<const StartCandidate> entrants);
  /// Puts a limb of q (or a forearm) elsewhere if that explains clearly more. Leaves the coarse refiner anywhere.
  bool better_limb(const Observation& observation, const ShapeVector& beta, bool forearms, PoseVector& q, int& iterations);
  /// The same for a winner of a race.
  bool replace_limb(const Observation& observation, Solution& solution);
  /// Takes a limb's other pose where that explains the cloud better. False: the refiner does not stand at the solution any more.
  /// `forearms`: also with one forearm turned about. `gain`: the share of the evidence's energy that it may leave.
  bool find_lost_limbs(const Observation& observation, const RefineSchedule& schedule, const Vertices* velocity, bool forearms, double gain,
                       Solution& solution);
  /// A frame that convinces, after a quick refinement, leaves clearly more of the cloud than this person's frames usually do, and has for a while.
  bool uneasy(const RefineReport& report, double time);
  /// Where only a cloud is known: limbs that it shows nothing of are left to the priors. The refiner stands at the solution before and after.
  void leave_out_unseen(const Observation& observation, const RefineSchedule& schedule, Solution& solution);
  /// Where only a cloud is known, and it is not explained: whether it is that of somebody without legs, whose head is what is highest.
  void start_from_top(const Observation& observation, Solution& solution);
  /// The last refinement of a start where clothes were seen: the pose is that of the clothes, nearly, and the body is inside them.
  void undress(const Observation& observation, Solution& solution);
  bool start_afresh(const Observation& observation, Solution& solution);
  static bool accepted(const RefineReport& report, const Observation& observation);
  /// Of a start: a body that hardly anybody has, standing where cameras saw through, is nobody's.
  static void refuse_strange(Solution& solution);
  void learn_shape(const Solution& solution);
  void refine_fine(const Observation& observation, const RefineSchedule& schedule, const PoseBelief& belief, const Vertices* velocity, Solution& solution);

  const BodyModel& model_;
  const PosePrior& prior_;
  const FitParts parts_;
  RefineWeights weights_, fine_weights_;
  double clothed_ = 1;  ///< what points outside the body weigh once the pose is known
  StartSearch search_;
  Refiner rough_, coarse_, fine_;
  PartSupport support_;
  RefineSchedule rough_schedule_, coarse_schedule_, limb_glance_schedule_, limb_schedule_, middle_schedule_, start_schedule_, thorough_track_schedule_,
      track_schedule_;

  // What is remembered of the person.
  PoseVector q_ = PoseVector::Zero(), velocity_ = PoseVector::Zero();
  ShapeVector beta_;
  ShapeBelief belief_, no_belief_, rough_belief_;
  double time_ = 0;
  int shape_frames_ = 0, tracked_frames_ = 0;
  BoneSet unseen_ = 0;         ///< while clouds without images are followed
  double doubtful_since_ = 0;  ///< time of the last convincing frame, or of the last fresh start that did not help
  double patience_ = 0;        ///< seconds of doubt before the next fresh start
  double fruitless_ = 1;       ///< what the body left of the cloud when a fresh start had not helped
  bool clear_ = false;         ///< the frame before left little of the cloud
  double usual_ = 0;           ///< what frames of this person leave of the cloud when all is well: RefineReport::data of quick refinements
  double easy_at_ = 0;         ///< time of the last frame that left no more than usual
  double next_look_ = 0;       ///< time before which no limb is looked for because of what is more than usual
  Vertices vertex_velocity_;
  std::vector<StartCandidate> candidates_;
  std::vector<Solution> solutions_;
  static constexpr int kFinalists = 3;  ///< candidates that get a second refinement, with some shape
  std::array<PoseVector, kFinalists> finalists_;
  int finalist_count_ = 0;
};

}  // namespace booth::fit
