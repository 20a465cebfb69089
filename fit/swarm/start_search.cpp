// All pairs of model vertices and cloud points give both directions of the distance at once: a microsecond for a glance at a candidate, a few for a look.
#include "fit/swarm/start_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fit/body/exact_math.hpp"
#include "fit/kernel.hpp"

namespace booth::fit {
namespace {

constexpr float kCutoff2 = 0.25f * 0.25f;  // m^2; further away is just wrong
constexpr float kNormalCost = 0.02f;       // m^2 for a right angle between the normals
constexpr float kSameCandidate = 0.10f;    // m, root mean square of the samples: refining both would find the same minimum
constexpr int kTasks = 32;
constexpr int kLookShare = 6;                               // of the candidates, the best one in so many is judged by all samples
constexpr float kUnseenBelow = 0.03f;                       // m that the middle of a lying body is below that of its points: no camera sees its lower side
constexpr double kUpright2 = 0.64;                          // squared vertical part of the longest axis of a body that does not lie
constexpr float kNotWorse = 1.01f;                          // of the cost, so much may a limb's new angles leave: refinement decides
constexpr int kMostLimbPoses = 64;                          // of a limb that are tried: exemplars share many
constexpr double kOtherPose = 0.3;                          // rad; angles closer than this (largest difference) refine to the same
constexpr std::array<int, 4> kLimbFirstDof{9, 15, 24, 30};  // clavicle to forearm, hip to foot; six angles each
constexpr std::array<int, 2> kUpperArms{14, 18};            // bones of the first two limbs
constexpr int kTwists = 8;                                  // of an upper arm
constexpr std::array<double, 3> kBends{0.3, 1.0, 1.8};      // rad, of an elbow

/// For each cloud point the least cost to any vertex; each vertex's least cost in `column`.
BOOTH_KERNEL void pair_costs(const float* ax, const float* ay, const float* az, const float* anx, const float* any, const float* anz, int na, const float* bx,
                             const float* by, const float* bz, const float* bnx, const float* bny, const float* bnz, int nb, float* row_min,
                             float* column_min) {
  for (int j = 0; j < nb; ++j) column_min[j] = kCutoff2;
  float cost[StartSearch::kLimbSamples];
  for (int i = 0; i < na; ++i) {
    const float x = ax[i], y = ay[i], z = az[i], nx = anx[i], ny = any[i], nz = anz[i];
    for (int j = 0; j < nb; ++j) {
      const float dx = x - bx[j], dy = y - by[j], dz = z - bz[j];
      const float turn = 1 - (nx * bnx[j] + ny * bny[j] + nz * bnz[j]);
      cost[j] = (dx * dx + dy * dy) + (dz * dz + kNormalCost * turn);
    }
    for (int j = 0; j < nb; ++j) column_min[j] = cost[j] < column_min[j] ? cost[j] : column_min[j];
    float least[16];
    for (int j = 0; j < 16; ++j) least[j] = kCutoff2;
    for (int j = 0; j + 16 <= nb; j += 16)
      for (int k = 0; k < 16; ++k) least[k] = cost[j + k] < least[k] ? cost[j + k] : least[k];
    float best = kCutoff2;
    for (int k = 0; k < 16; ++k) best = least[k] < best ? least[k] : best;
    row_min[i] = best;
  }
}

/// out = matrix * in, for points and normals alike.
BOOTH_KERNEL void turn_all(const float* m, const float* x, const float* y, const float* z, int count, float* ox, float* oy, float* oz) {
  for (int i = 0; i < count; ++i) {
    const float a = x[i], b = y[i], c = z[i];
    ox[i] = m[0] * a + m[1] * b + m[2] * c;
    oy[i] = m[3] * a + m[4] * b + m[5] * c;
    oz[i] = m[6] * a + m[7] * b + m[8] * c;
  }
}

/// The direction in which the points are spread most, by squaring their covariance until one direction is left.
Eigen::Vector3d longest_axis(const std::vector<float>& x, const std::vector<float>& y, const std::vector<float>& z, int count) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int i = 0; i < count; ++i) mean += Eigen::Vector3f(x[i], y[i], z[i]).cast<double>() / count;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d d = Eigen::Vector3f(x[i], y[i], z[i]).cast<double>() - mean;
    spread += d * d.transpose();
  }
  for (int k = 0; k < 8; ++k) {
    spread /= std::max(spread.trace(), 1e-12);
    spread = (spread * spread).eval();
  }
  Eigen::Index longest = 0;
  spread.diagonal().maxCoeff(&longest);
  return spread.col(longest).normalized();
}

}  // namespace

StartSearch::Sample::Sample(int capacity) {
  for (auto* a : {&x, &y, &z, &nx, &ny, &nz}) a->assign(static_cast<std::size_t>(capacity), 0);
}

StartSearch::StartSearch(const BodyModel& model, const PosePrior& prior, WorkerPool& pool)
    : prior_(prior),
      pool_(pool),
      poser_(model, model.shape_count(), kSamples),
      limb_poser_(model, model.shape_count(), kLimbSamples),
      samples_(poser_.size() / 16 * 16),
      limb_samples_(limb_poser_.size() / 16 * 16),
      cloud_(kLimbSamples),
      glance_(kGlance) {
  const auto count = static_cast<std::size_t>(prior.exemplars.cols());
  leaning_.assign(count, Sample(kSamples));
  straight_.assign(count, Sample(kSamples));
  turns_.reserve(kMostTurns);
  candidates_.reserve(count * kMostTurns);
  limb_poses_.reserve(kMostLimbPoses + kTwists * kBends.size());
  limb_order_.reserve(limb_poses_.capacity());
  chosen_.assign(kMostCandidates, Sample(kSamples));
  work_.assign(kTasks, Sample(kSamples));
  // Limb poses that differ: each time the one that is farthest from those there are.
  for (std::size_t limb = 0; limb < kLimbs; ++limb) {
    std::vector<double> distance(count, std::numeric_limits<double>::max());
    for (Eigen::Index next = 0; limb_choice_[limb].size() < kMostLimbPoses;) {
      limb_choice_[limb].push_back(static_cast<int>(next));
      const Eigen::Matrix<double, 6, 1> angles = prior.exemplars.col(next).segment<6>(kLimbFirstDof[limb]);
      for (std::size_t e = 0; e < count; ++e)
        distance[e] = std::min(distance[e], (prior.exemplars.col(static_cast<Eigen::Index>(e)).segment<6>(kLimbFirstDof[limb]) - angles).cwiseAbs().maxCoeff());
      const auto farthest = std::max_element(distance.begin(), distance.end());
      if (*farthest < kOtherPose) break;
      next = farthest - distance.begin();
    }
  }
  set_shape(ShapeVector::Zero(model.shape_count()));
}

std::size_t StartSearch::memory_bytes() const {
  const std::size_t samples = leaning_.size() + straight_.size() + chosen_.size() + work_.size();
  std::size_t choices = 0;
  for (const auto& c : limb_choice_) choices += c.capacity() * sizeof(int);
  return sizeof(*this) + poser_.memory_bytes() + limb_poser_.memory_bytes() + samples * (sizeof(Sample) + 6 * kSamples * sizeof(float)) +
         6 * (kLimbSamples + kGlance) * sizeof(float) + turns_.capacity() * sizeof(Turn) + candidates_.capacity() * sizeof(candidates_[0]) +
         limb_poses_.capacity() * sizeof(LimbPose) + limb_order_.capacity() * sizeof(limb_order_[0]) + choices;
}

void StartSearch::set_shape(const ShapeVector& beta) {
  poser_.set_shape(beta);
  for (std::size_t e = 0; e < leaning_.size(); ++e) {
    PoseVector q = prior_.exemplars.col(static_cast<Eigen::Index>(e));
    q[0] = q[1] = q[2] = q[4] = 0;
    for (Sample* s : {&leaning_[e], &straight_[e]}) {
      poser_.set_pose(q);
      for (auto [to, from] :
           {std::pair{&s->x, &poser_.x}, {&s->y, &poser_.y}, {&s->z, &poser_.z}, {&s->nx, &poser_.nx}, {&s->ny, &poser_.ny}, {&s->nz, &poser_.nz}})
        std::copy_n(from->begin(), samples_, to->begin());
      q[3] = q[5] = 0;
    }
  }
}

StartSearch::Turn StartSearch::turned(double rx, double ry, double rz, bool upright) {
  const auto [sx, cx] = exact_sincos(rx);
  const auto [sy, cy] = exact_sincos(ry);
  const auto [sz, cz] = exact_sincos(rz);
  const Eigen::Matrix3d x = (Eigen::Matrix3d() << 1, 0, 0, 0, cx, -sx, 0, sx, cx).finished();
  const Eigen::Matrix3d y = (Eigen::Matrix3d() << cy, 0, sy, 0, 1, 0, -sy, 0, cy).finished();
  const Eigen::Matrix3d z = (Eigen::Matrix3d() << cz, -sz, 0, sz, cz, 0, 0, 0, 1).finished();
  Turn turn{{rx, ry, rz}, {}, upright};
  const Eigen::Matrix3d m = y * x * z;  // docs/reference/skeleton.md
  for (int i = 0; i < 9; ++i) turn.matrix[static_cast<std::size_t>(i)] = static_cast<float>(m(i / 3, i % 3));
  return turn;
}

void StartSearch::list_turns() {
  constexpr double pi = std::numbers::pi;
  turns_.clear();
  for (int h = 0; h < kHeadings; ++h) turns_.push_back(turned(0, (h > kHeadings / 2 ? h - kHeadings : h) * 2 * pi / kHeadings, 0, true));
  const Eigen::Vector3d axis = longest_axis(cloud_.x, cloud_.y, cloud_.z, cloud_samples_);
  const double flat = std::sqrt(axis.x() * axis.x() + axis.z() * axis.z());
  if (from_top_ || axis.y() * axis.y() > kUpright2 || !(flat > 0)) return;
  // A quarter turn about z lays the body along -x, so that a turn about x rolls it and the heading points it along the cloud.
  for (const double sense : {1.0, -1.0}) {
    const double heading = exact_angle(sense * axis.z() / flat, -sense * axis.x() / flat);
    for (int r = 0; r < kRolls; ++r) turns_.push_back(turned((r > kRolls / 2 ? r - kRolls : r) * 2 * pi / kRolls, heading, pi / 2, false));
  }
}

Eigen::Vector3f StartSearch::place(int exemplar, const Turn& turn, Sample& out) const {
  const Sample& from = (turn.upright ? leaning_ : straight_)[static_cast<std::size_t>(exemplar)];
  turn_all(turn.matrix.data(), from.x.data(), from.y.data(), from.z.data(), samples_, out.x.data(), out.y.data(), out.z.data());
  turn_all(turn.matrix.data(), from.nx.data(), from.ny.data(), from.nz.data(), samples_, out.nx.data(), out.ny.data(), out.nz.data());
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
  for (int i = 0; i < samples_; ++i) sum += Eigen::Vector3f(out.x[i], out.y[i], out.z[i]), low = std::min(low, out.y[i]), high = std::max(high, out.y[i]);
  Eigen::Vector3f root = middle_ - sum / static_cast<float>(samples_);
  // Who stands, stands on the floor; who lies may lie on an arm that the exemplar has elsewhere.
  root.y() = turn.upright ? ground_ - low : std::max(ground_ - low, root.y() - kUnseenBelow);
  if (from_top_) root.y() = top_ - high;
  for (int i = 0; i < samples_; ++i) out.x[i] += root.x(), out.y[i] += root.y(), out.z[i] += root.z();
  return root;
}

PoseVector StartSearch::pose_of(int candidate) const {
  const int exemplar = candidate / kMostTurns;
  const Turn& turn = turns_[static_cast<std::size_t>(candidate % kMostTurns)];
  PoseVector q = prior_.exemplars.col(exemplar);
  q[4] = turn.angles[1];
  if (!turn.upright) q[3] = turn.angles[0], q[5] = turn.angles[2];
  return q;
}

float StartSearch::score(const Sample& cloud, int cloud_count, const Sample& body, int count) {
  return score(cloud, cloud_count, body.x.data(), body.y.data(), body.z.data(), body.nx.data(), body.ny.data(), body.nz.data(), count);
}

float StartSearch::score(const Sample& cloud, int cloud_count, const float* x, const float* y, const float* z, const float* nx, const float* ny,
                         const float* nz, int count) {
  float row[kLimbSamples], column[kLimbSamples];
  pair_costs(cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.nx.data(), cloud.ny.data(), cloud.nz.data(), cloud_count, x, y, z, nx, ny, nz, count, row,
             column);
  float unexplained = 0, unseen = 0;
  for (int i = 0; i < cloud_count; ++i) unexplained += row[i];
  for (int j = 0; j < count; ++j) unseen += column[j];
  // A hole in the cloud is weak evidence; a point that the body does not explain is strong.
  return unexplained / static_cast<float>(cloud_count) + 0.5f * unseen / static_cast<float>(count);
}

int StartSearch::sample_cloud(const Cloud& cloud, int most, Sample& out) {
  const int count = std::min<int>(most, cloud.size);
  for (int s = 0; s < count; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count);
    out.x[s] = cloud.x[i], out.y[s] = cloud.y[i], out.z[s] = cloud.z[i];
    out.nx[s] = cloud.nx[i], out.ny[s] = cloud.ny[i], out.nz[s] = cloud.nz[i];
  }
  return count;
}

void StartSearch::list_limb_poses(int limb, const PoseVector& q, bool forearms) {
  const int first = kLimbFirstDof[static_cast<std::size_t>(limb)];
  limb_poses_.clear();
  for (const int e : limb_choice_[static_cast<std::size_t>(limb)]) limb_poses_.push_back(prior_.exemplars.col(e).segment<6>(first));
  if (!forearms || limb >= static_cast<int>(kUpperArms.size())) return;
  // The forearm by itself: an elbow in its place, bent another way.
  for (int t = 0; t < kTwists; ++t) {
    PoseVector turned = q;
    turn_about_length(kUpperArms[static_cast<std::size_t>(limb)], t * 2 * std::numbers::pi / kTwists, turned);
    LimbPose pose = turned.segment<6>(first);
    for (const double bend : kBends) {
      pose[5] = bend;
      limb_poses_.push_back(pose);
    }
  }
}

int StartSearch::propose_limbs(const Observation& observation, const ShapeVector& beta, const PoseVector& q, bool forearms,
                               std::span<PoseVector, kLimbs * kPerLimb> out) {
  if (observation.cloud.size < 50) return 0;
  cloud_samples_ = sample_cloud(observation.cloud, kLimbSamples, cloud_);
  if (beta != limb_shape_) {
    limb_poser_.set_shape(beta);
    limb_shape_ = beta;
  }
  const auto cost_of = [&](const PoseVector& pose) {
    limb_poser_.set_pose(pose);
    return score(cloud_, cloud_samples_, limb_poser_.x.data(), limb_poser_.y.data(), limb_poser_.z.data(), limb_poser_.nx.data(), limb_poser_.ny.data(),
                 limb_poser_.nz.data(), limb_samples_);
  };
  const float limit = kNotWorse * cost_of(q);
  int count = 0;
  for (int limb = 0; limb < kLimbs; ++limb) {
    const int first = kLimbFirstDof[static_cast<std::size_t>(limb)];
    const auto other = [](const LimbPose& a, const LimbPose& b) { return (a - b).cwiseAbs().maxCoeff() > kOtherPose; };
    list_limb_poses(limb, q, forearms);
    limb_order_.clear();
    PoseVector trial = q;
    for (std::size_t k = 0; k < limb_poses_.size(); ++k) {
      trial.segment<6>(first) = limb_poses_[k];
      if (const float c = cost_of(trial); c < limit && other(limb_poses_[k], q.segment<6>(first))) limb_order_.push_back({c, static_cast<int>(k)});
    }
    std::sort(limb_order_.begin(), limb_order_.end());
    const int begin = count;
    for (const auto& [cost, k] : limb_order_) {
      if (count == begin + kPerLimb) break;
      const LimbPose& pose = limb_poses_[static_cast<std::size_t>(k)];
      bool is_new = true;
      for (int o = begin; o < count; ++o) is_new = is_new && other(pose, out[static_cast<std::size_t>(o)].segment<6>(first));
      if (!is_new) continue;
      trial.segment<6>(first) = pose;
      out[static_cast<std::size_t>(count++)] = trial;
    }
  }
  return count;
}

void StartSearch::judge(int begin, int end, const Sample& cloud, int cloud_count, int count) {
  pool_.run(kTasks, [&](int task) {
    Sample& s = work_[static_cast<std::size_t>(task)];
    const int total = end - begin;
    for (int c = begin + total * task / kTasks; c < begin + total * (task + 1) / kTasks; ++c) {
      auto& [cost, candidate] = candidates_[static_cast<std::size_t>(c)];
      place(candidate / kMostTurns, turns_[static_cast<std::size_t>(candidate % kMostTurns)], s);
      cost = score(cloud, cloud_count, s, count);
    }
  });
}

void StartSearch::search(const Observation& observation, int count, std::vector<StartCandidate>& out, bool from_top) {
  out.clear();
  const Cloud& cloud = observation.cloud;
  if (cloud.size < 50) return;
  cloud_samples_ = sample_cloud(cloud, kSamples, cloud_);
  glance_samples_ = sample_cloud(cloud, kGlance, glance_);
  middle_.setZero();
  float low = std::numeric_limits<float>::max();
  from_top_ = from_top;
  top_ = std::numeric_limits<float>::lowest();
  for (int s = 0; s < cloud_samples_; ++s) {
    middle_ += Eigen::Vector3f(cloud_.x[s], cloud_.y[s], cloud_.z[s]);
    low = std::min(low, cloud_.y[s]), top_ = std::max(top_, cloud_.y[s]);
  }
  middle_ /= static_cast<float>(cloud_samples_);
  // The body stands on the floor where that is known, else on the cloud's lowest point; jumpers are found by refinement.
  ground_ = observation.floor_known ? std::max(observation.floor_height, low - 0.15f) : low;
  list_turns();

  candidates_.clear();
  for (int e = 0; e < static_cast<int>(leaning_.size()); ++e)
    for (int t = 0; t < static_cast<int>(turns_.size()); ++t) candidates_.push_back({0.0f, e * kMostTurns + t});
  const int total = static_cast<int>(candidates_.size());
  judge(0, total, glance_, glance_samples_, std::min(kGlance, samples_));
  const int looked_at = std::min(total, std::max(kMostCandidates, total / kLookShare));
  std::nth_element(candidates_.begin(), candidates_.begin() + (looked_at - 1), candidates_.end());
  judge(0, looked_at, cloud_, cloud_samples_, samples_);
  std::sort(candidates_.begin(), candidates_.begin() + looked_at);

  count = std::min(count, kMostCandidates);
  Sample& body = work_.front();
  for (int c = 0; c < looked_at && static_cast<int>(out.size()) < count; ++c) {
    const auto [cost, candidate] = candidates_[static_cast<std::size_t>(c)];
    const Eigen::Vector3f root = place(candidate / kMostTurns, turns_[static_cast<std::size_t>(candidate % kMostTurns)], body);
    bool is_new = true;
    for (std::size_t k = 0; k < out.size() && is_new; ++k) {
      const Sample& other = chosen_[k];
      float sum = 0;
      for (int i = 0; i < samples_; ++i) {
        const float dx = body.x[i] - other.x[i], dy = body.y[i] - other.y[i], dz = body.z[i] - other.z[i];
        sum += dx * dx + dy * dy + dz * dz;
      }
      is_new = sum > kSameCandidate * kSameCandidate * static_cast<float>(samples_);
    }
    if (!is_new) continue;
    std::swap(chosen_[out.size()], body);
    PoseVector q = pose_of(candidate);
    q.head<3>() = root.cast<double>();
    out.push_back({q, cost});
  }
}

}  // namespace booth::fit
