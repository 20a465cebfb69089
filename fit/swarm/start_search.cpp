// All pairs of 128 model vertices and 128 cloud points give both directions of the distance at once: a few microseconds a candidate.
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
constexpr float kNotWorse = 1.01f;                          // of the cost, so much may a limb's new angles leave: refinement decides
constexpr double kOtherPose = 0.3;                          // rad; angles closer than this (largest difference) refine to the same
constexpr std::array<int, 4> kLimbFirstDof{9, 15, 24, 30};  // clavicle to forearm, hip to foot; six angles each

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

}  // namespace

StartSearch::StartSearch(const BodyModel& model, const PosePrior& prior, WorkerPool& pool)
    : prior_(prior),
      pool_(pool),
      poser_(model, model.shape_count(), kSamples),
      limb_poser_(model, model.shape_count(), kLimbSamples),
      samples_(poser_.size() / 16 * 16),
      limb_samples_(limb_poser_.size() / 16 * 16) {
  const auto count = static_cast<std::size_t>(prior.exemplars.cols());
  const auto make = [] {
    Sample s;
    for (auto* a : {&s.x, &s.y, &s.z, &s.nx, &s.ny, &s.nz}) a->assign(kLimbSamples, 0);
    return s;
  };
  exemplar_.assign(count, make());
  centre_.resize(count);
  low_.resize(count);
  cloud_ = make();
  candidates_.resize(count * kHeadings);
  order_.resize(count * kHeadings);
  limb_order_.reserve(count);
  chosen_.assign(64, make());
  work_.assign(kTasks, make());
  set_shape(ShapeVector::Zero(model.shape_count()));
}

void StartSearch::set_shape(const ShapeVector& beta) {
  poser_.set_shape(beta);
  for (std::size_t e = 0; e < exemplar_.size(); ++e) {
    PoseVector q = prior_.exemplars.col(static_cast<Eigen::Index>(e));
    q[0] = q[1] = q[2] = q[4] = 0;
    poser_.set_pose(q);
    Sample& s = exemplar_[e];
    float cx = 0, cz = 0, low = std::numeric_limits<float>::max();
    for (int i = 0; i < samples_; ++i) cx += poser_.x[i], cz += poser_.z[i], low = std::min(low, poser_.y[i]);
    cx /= static_cast<float>(samples_), cz /= static_cast<float>(samples_);
    for (int i = 0; i < samples_; ++i) {
      s.x[i] = poser_.x[i] - cx, s.y[i] = poser_.y[i], s.z[i] = poser_.z[i] - cz;
      s.nx[i] = poser_.nx[i], s.ny[i] = poser_.ny[i], s.nz[i] = poser_.nz[i];
    }
    centre_[e] = {cx, cz};
    low_[e] = low;
  }
}

float StartSearch::score(const Sample& body) const { return score(body.x, body.y, body.z, body.nx, body.ny, body.nz, samples_); }

float StartSearch::score(const std::vector<float>& x, const std::vector<float>& y, const std::vector<float>& z, const std::vector<float>& nx,
                         const std::vector<float>& ny, const std::vector<float>& nz, int count) const {
  float row[kLimbSamples], column[kLimbSamples];
  pair_costs(cloud_.x.data(), cloud_.y.data(), cloud_.z.data(), cloud_.nx.data(), cloud_.ny.data(), cloud_.nz.data(), cloud_samples_, x.data(), y.data(),
             z.data(), nx.data(), ny.data(), nz.data(), count, row, column);
  float unexplained = 0, unseen = 0;
  for (int i = 0; i < cloud_samples_; ++i) unexplained += row[i];
  for (int j = 0; j < count; ++j) unseen += column[j];
  // A hole in the cloud is weak evidence; a point that the body does not explain is strong.
  return unexplained / static_cast<float>(cloud_samples_) + 0.5f * unseen / static_cast<float>(count);
}

void StartSearch::sample_cloud(const Cloud& cloud, int most) {
  cloud_samples_ = std::min<int>(most, cloud.size);
  for (int s = 0; s < cloud_samples_; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / cloud_samples_);
    cloud_.x[s] = cloud.x[i], cloud_.y[s] = cloud.y[i], cloud_.z[s] = cloud.z[i];
    cloud_.nx[s] = cloud.nx[i], cloud_.ny[s] = cloud.ny[i], cloud_.nz[s] = cloud.nz[i];
  }
}

int StartSearch::propose_limbs(const Observation& observation, const ShapeVector& beta, const PoseVector& q, std::span<PoseVector, kLimbs * kPerLimb> out) {
  if (observation.cloud.size < 50) return 0;
  sample_cloud(observation.cloud, kLimbSamples);
  if (beta != limb_shape_) {
    limb_poser_.set_shape(beta);
    limb_shape_ = beta;
  }
  const auto cost_of = [&](const PoseVector& pose) {
    limb_poser_.set_pose(pose);
    return score(limb_poser_.x, limb_poser_.y, limb_poser_.z, limb_poser_.nx, limb_poser_.ny, limb_poser_.nz, limb_samples_);
  };
  const float limit = kNotWorse * cost_of(q);
  int count = 0;
  for (int first : kLimbFirstDof) {
    const auto other = [&](const PoseVector& a, const PoseVector& b) { return (a - b).segment<6>(first).cwiseAbs().maxCoeff() > kOtherPose; };
    limb_order_.clear();
    for (Eigen::Index e = 0; e < prior_.exemplars.cols(); ++e) {
      PoseVector trial = q;
      trial.segment<6>(first) = prior_.exemplars.col(e).segment<6>(first);
      if (const float c = cost_of(trial); c < limit && other(trial, q)) limb_order_.push_back({c, static_cast<int>(e)});
    }
    std::sort(limb_order_.begin(), limb_order_.end());
    const int begin = count;
    for (const auto& [cost, e] : limb_order_) {
      if (count == begin + kPerLimb) break;
      PoseVector trial = q;
      trial.segment<6>(first) = prior_.exemplars.col(e).segment<6>(first);
      bool is_new = true;
      for (int k = begin; k < count; ++k) is_new = is_new && other(trial, out[static_cast<std::size_t>(k)]);
      if (is_new) out[static_cast<std::size_t>(count++)] = trial;
    }
  }
  return count;
}

void StartSearch::search(const Observation& observation, int count, std::vector<StartCandidate>& out) {
  out.clear();
  const Cloud& cloud = observation.cloud;
  if (cloud.size < 50) return;
  sample_cloud(cloud, kSamples);
  float cx = 0, cz = 0, low = std::numeric_limits<float>::max();
  for (int s = 0; s < cloud_samples_; ++s) cx += cloud_.x[s], cz += cloud_.z[s], low = std::min(low, cloud_.y[s]);
  cx /= static_cast<float>(cloud_samples_), cz /= static_cast<float>(cloud_samples_);
  // The body stands on the floor where that is known, else on the cloud's lowest point; jumpers are found by refinement.
  const float ground = observation.floor_known ? std::max(observation.floor_height, low - 0.15f) : low;

  const int total = static_cast<int>(candidates_.size());
  pool_.run(kTasks, [&](int task) {
    Sample& s = work_[static_cast<std::size_t>(task)];
    for (int c = total * task / kTasks; c < total * (task + 1) / kTasks; ++c) {
      const auto e = static_cast<std::size_t>(c / kHeadings);
      const auto [sine, cosine] = exact_sincos(2 * std::numbers::pi / kHeadings * (c % kHeadings));
      const float sn = static_cast<float>(sine), cs = static_cast<float>(cosine);
      const Sample& from = exemplar_[e];
      const float lift = ground - low_[e];
      for (int i = 0; i < samples_; ++i) {
        s.x[i] = cs * from.x[i] + sn * from.z[i] + cx;
        s.y[i] = from.y[i] + lift;
        s.z[i] = -sn * from.x[i] + cs * from.z[i] + cz;
        s.nx[i] = cs * from.nx[i] + sn * from.nz[i];
        s.ny[i] = from.ny[i];
        s.nz[i] = -sn * from.nx[i] + cs * from.nz[i];
      }
      StartCandidate& candidate = candidates_[static_cast<std::size_t>(c)];
      candidate.cost = score(s);
      candidate.q = prior_.exemplars.col(static_cast<Eigen::Index>(e));
      candidate.q[4] = 2 * std::numbers::pi / kHeadings * (c % kHeadings);
      if (candidate.q[4] > std::numbers::pi) candidate.q[4] -= 2 * std::numbers::pi;
      // The samples' centre is at the cloud's; the root stands beside it.
      candidate.q[0] = static_cast<double>(cx - (cs * centre_[e].x() + sn * centre_[e].y()));
      candidate.q[1] = static_cast<double>(lift);
      candidate.q[2] = static_cast<double>(cz - (-sn * centre_[e].x() + cs * centre_[e].y()));
    }
  });

  for (int c = 0; c < total; ++c) order_[static_cast<std::size_t>(c)] = c;
  std::sort(order_.begin(), order_.end(), [&](int a, int b) {
    const float ca = candidates_[static_cast<std::size_t>(a)].cost, cb = candidates_[static_cast<std::size_t>(b)].cost;
    return ca != cb ? ca < cb : a < b;
  });
  count = std::min<int>(count, static_cast<int>(chosen_.size()));
  for (int c : order_) {
    if (static_cast<int>(out.size()) == count) break;
    const StartCandidate& candidate = candidates_[static_cast<std::size_t>(c)];
    poser_.set_pose(candidate.q);
    bool is_new = true;
    for (std::size_t k = 0; k < out.size() && is_new; ++k) {
      const Sample& other = chosen_[k];
      float sum = 0;
      for (int i = 0; i < samples_; ++i) {
        const float dx = poser_.x[i] - other.x[i], dy = poser_.y[i] - other.y[i], dz = poser_.z[i] - other.z[i];
        sum += dx * dx + dy * dy + dz * dz;
      }
      is_new = sum > kSameCandidate * kSameCandidate * static_cast<float>(samples_);
    }
    if (!is_new) continue;
    Sample& keep = chosen_[out.size()];
    std::copy_n(poser_.x.begin(), samples_, keep.x.begin());
    std::copy_n(poser_.y.begin(), samples_, keep.y.begin());
    std::copy_n(poser_.z.begin(), samples_, keep.z.begin());
    out.push_back(candidate);
  }
}

}  // namespace booth::fit
