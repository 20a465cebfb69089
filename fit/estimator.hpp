// The estimator as the daemon sees it: observations in, a body and a skeleton out, one call a frame.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "fit/body/body_model.hpp"
#include "fit/body/measure.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/prior/pose_prior.hpp"
#include "fit/swarm/guarded_swarm.hpp"
#include "fit/track/fit_parts.hpp"

namespace booth::gpu {
template <class Kernels>
class Device;
}  // namespace booth::gpu

namespace booth::fit {

enum class Preset : std::uint8_t { booth, paper };
/// What computes preset paper's swarm; preset booth has none and always works on the CPU.
enum class BackendChoice : std::uint8_t {
  cpu,
  cuda,       ///< a CUDA device, with the CPU to take over when it fails
  automatic,  ///< cuda where this build has it
};
namespace device {
struct Kernels;
using Device = gpu::Device<Kernels>;
}  // namespace device
/// Opens the device that a swarm is to live on; null where there is none, `why` then says it in a sentence. May throw std::exception.
using DeviceOpen = std::function<std::unique_ptr<device::Device>(std::string& why)>;

enum class SexChoice : std::uint8_t { automatic, men, women };

struct EstimatorSettings {
  Preset preset = Preset::booth;
  SexChoice sex = SexChoice::automatic;
  BackendChoice backend = BackendChoice::cpu;
  bool clothed = false;  ///< preset booth: what is seen is clothes, and the body is under them
  int threads = 2;       ///< workers, the caller included; the result does not depend on it
  std::uint64_t seed = 1;
  int cloud_capacity = 120000;
  int max_views = 8;
  SwarmSettings swarm{};  ///< preset paper; `particles` is the CPU's
  /// Preset paper on a device: chosen from the curve of error against budget (docs/guide/gpu.md).
  int device_particles = 5000;
  DeviceOpen open_device{};  ///< in place of the CUDA device, for tests: an emulated one
  GuardSettings guard{};     ///< how soon a lost device is tried again
  FitParts parts{};          ///< for studies; the product leaves it alone
};

enum class FitState : std::uint8_t {
  lost,       ///< no person, or none that the model explains
  estimated,  ///< found from nothing in this frame
  tracked,    ///< followed from the frame before
};

enum class JointVisibility : std::uint8_t { seen, inferred };

/// Energy terms of MATH.md 3 (and ours), unweighted; zero where a term was not active.
struct EnergyTerms {
  double point = 0, plane = 0, shape = 0, bone = 0, pose = 0;           // eq. 5, 6, 9, 7, 12
  double cloud_to_model = 0, free_space = 0, limits = 0, temporal = 0;  // ours
  double total = 0;                                                     // weighted sum
};

struct DistanceStatistics {
  double mean = 0, median = 0, p95 = 0;  ///< metres
};

struct FitResult {
  FitState state = FitState::lost;
  Sex sex = Sex::men;
  PoseVector q = PoseVector::Zero();
  ShapeVector beta;
  Points3 joints = Points3::Zero();                       ///< CMU frame, metres
  std::array<Eigen::Quaterniond, kBones> bone_rotation;   ///< world rotation of each bone, CMU frame
  std::array<Eigen::Matrix3d, kJoints> joint_covariance;  ///< m^2
  std::array<JointVisibility, kJoints> visibility{};
  std::uint32_t unseen = 0;      ///< bit b: the cloud, without images, shows nothing of bone b, which the priors placed
  ShapeMatrix shape_covariance;  ///< of beta, for measure_with_sd(); empty where nothing is known (preset paper)
  EnergyTerms energy;
  DistanceStatistics cloud_to_model;  ///< distance of the cloud's points to the fitted surface
  DistanceStatistics model_to_cloud;  ///< of visible model vertices to the nearest cloud point
  double coverage = 0;                ///< fraction of the model's surface that some point explains
  int iterations = 0;
  bool body_accepted = false;  ///< the shape has settled: this is the person's body
};

/// Allocates everything in the constructor; fit() and track() allocate nothing. One thread calls at a time.
/// The same observations and seed give the same bits for any number of threads.
class Estimator {
 public:
  /// At least one of the models must be given; `automatic` fits each that is there and keeps the better.
  /// Throws std::invalid_argument when the models do not fit together.
  Estimator(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, std::shared_ptr<const PosePrior> prior, EstimatorSettings settings);
  ~Estimator();

  /// Forgets the person: the next step() starts from nothing.
  void reset();

  /// The next step() estimates, whoever was followed. A body that has settled stays known; one that has not is forgotten, and the settled one known again
  /// whose place it took.
  void start_over();

  /// The next frame: estimates when there is no person yet or it was lost (re-acquisition keeps the body that was known), tracks otherwise.
  const FitResult& step(const Observation& observation);

  /// One individual from one moment, from nothing or from `initial` (q alone), to convergence.
  const FitResult& fit(const Observation& observation, const PoseVector* initial = nullptr);

  /// The model of the last result.
  const BodyModel& model() const;
  /// The fitted, posed vertices of the last result; CMU frame.
  const Vertices& posed_vertices() const;
  /// Of the device that computes the swarm; `wanted` is false where there is none to speak of. From any thread.
  DeviceReport device_report() const;
  /// Bytes taken at construction, for the memory plan.
  std::size_t memory_bytes() const;
  /// Of the device that was asked for: what it takes while it is there.
  DeviceBytes device_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace booth::fit
