// Levenberg-Marquardt on the two-sided energy of preset `booth`: explains the cloud, respects free space, stays human.
#pragma once

#include <memory>
#include <vector>

#include "fit/body/poser.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/cloud/point_grid.hpp"
#include "fit/parallel.hpp"
#include "fit/prior/pose_prior.hpp"
#include "fit/refine/normal_equations.hpp"
#include "fit/refine/part_support.hpp"

namespace booth::fit {

/// What is known of the pose before this frame. Zero inverse variance: nothing.
struct PoseBelief {
  PoseVector mean = PoseVector::Zero();
  PoseVector inverse_variance = PoseVector::Zero();
};

/// What is known of the shape before this frame: a Gaussian over the coefficients in use, in their own units.
struct ShapeBelief {
  ShapeVector mean;
  UnknownMatrix information;
};

/// Relative trust in the terms; data are in units of independent measurements of standard deviation `sigma`.
struct RefineWeights {
  double sigma = 0.01;            ///< m, of one measured point's distance to the surface
  double effective_points = 600;  ///< how many independent measurements the whole cloud counts as
  double model_to_cloud = 200;    ///< independent measurements that the model's vertices count as, where schedule.model_to_cloud
  double tangential = 0.05;       ///< weight of point-to-point against point-to-plane
  double outside = 1;             ///< of points outside the body against those inside; below 1 for clothes, which never lie inside it
  double free_space = 200;        ///< independent measurements that the model's free-space and silhouette evidence counts as
  double floor = 50;              ///< and the floor
  double pose_outside = 25;       ///< 1 / rad^2, distance from the prior's subspace
  double pose_inside = 0.3;       ///< Mahalanobis distance inside it
  double limits = 100;            ///< 1 / rad^2 beyond a joint limit
  double bone = 4e4;              ///< 1 / m^2, left against right limb segments
  BoneSet unseen = 0;             ///< bones of which the cloud shows nothing: their vertices explain no points and look for none
};

struct RefineSchedule {
  int cloud_samples = 1500;
  int model_samples = 600;
  bool model_to_cloud = false;  ///< for clouds without views: vertices also look for the cloud
  bool shape = true;            ///< false: the shape is held
  double least_promise = 0;     ///< share of the energy that a step must promise to take off, else the stage ends without looking at it
  struct Stage {
    int iterations;
    float robust;  ///< m; residuals much larger than this lose their say
    float reach;   ///< m; how far a correspondence may be
  };
  std::vector<Stage> stages;
};

struct RefineReport {
  double energy = 0;       ///< at the solution, last stage's robust scale, without the priors' constant parts
  double evidence = 0;     ///< the part of the energy that is not priors: cloud, images, floor
  double data = 0;         ///< robust mean of the cloud's squared distance / robust^2: 0 = all explained, 1 = nothing
  double unexplained = 0;  ///< fraction of the cloud's points farther from the body than the robust scale
  double free_space = 0;   ///< fraction of the tested model samples that stand in free space
  int iterations = 0;
};

struct RefinerSize {
  int shape_count;    ///< coefficients that may be free
  int vertices;       ///< of the model, evenly spread, that stand for its surface; all when larger than the model
  int model_samples;  ///< most of them that are tested against images, floor and cloud
};

/// All buffers are taken in the constructor. One thread calls at a time; the work inside is spread over `pool` in fixed portions.
class Refiner {
 public:
  Refiner(const BodyModel& model, const PosePrior& prior, RefinerSize size, WorkerPool& pool);

  /// Moves q and beta (size shape_count()) to the nearest minimum. `velocity`, m/s per vertex, may be null: where cameras saw the person at
  /// other times than the reference instant, vertices are compared where they were then.
  RefineReport refine(const Observation& observation, const RefineWeights& weights, const RefineSchedule& schedule, const PoseBelief& pose_belief,
                      const ShapeBelief& shape_belief, const Vertices* velocity, PoseVector& q, ShapeVector& beta);

  int shape_count() const { return poser_.shape_count(); }
  /// State at the solution of the last refine().
  const Poser& poser() const { return poser_; }
  /// Poses the body without refining it. `beta` has size shape_count().
  void place(const PoseVector& q, const ShapeVector& beta);
  const PointGrid& grid() const { return grid_; }
  /// Information matrix (J^T W J with all priors) at the solution; 36 pose entries first, then the shape if it was free.
  const UnknownMatrix& information() const { return information_; }
  /// The data's own part of it.
  const UnknownMatrix& data_information() const { return data_information_; }
  /// Half the gradient of the data's own part of the energy there: it is what the priors hold against.
  const UnknownVector& data_gradient() const { return data_gradient_; }
  std::size_t memory_bytes() const;

 private:
  struct Problem;
  void fill_cloud_grid(const Cloud& cloud);
  void fill_grid(BoneSet unseen);
  /// The poser's vertices are in spread order, so its first ones are evenly spread.
  static int spread_vertex(int sample) { return sample; }
  /// `rows`: with derivatives; without, only the figures.
  void collect(const Problem& problem, int portion, bool rows);
  void add_priors(const Problem& problem, const PoseVector& q, const ShapeVector& beta, UnknownMatrix& h, UnknownVector& g, double& energy) const;

  const PosePrior& prior_;
  WorkerPool& pool_;
  Poser poser_;
  PointGrid grid_, cloud_grid_;
  Cloud thin_;               ///< what cloud_grid_ indexes
  std::vector<float> x_;     ///< of the vertices that may explain points, where not all may
  std::vector<float> fall_;  ///< facet_fall() of the poser's vertices
  int model_samples_;
  static constexpr int kPortions = 8, kThinCloud = 4000;
  struct Portion {
    NormalEquations equations;
    double data = 0, data_count = 0, unexplained = 0, violations = 0, tested = 0, energy = 0;
  };
  std::vector<Portion> portions_;
  UnknownMatrix information_, data_information_, hessian_, damped_;
  UnknownVector gradient_, data_gradient_, step_;
  ShapeVector shaped_;  ///< coefficients that the poser's shape was set to
};

}  // namespace booth::fit
