// Normals follow the shape to first order: n(beta) = n + sum beta_k dn/dbeta_k, so that eq. 6 uses the normal at (q, beta).
#include "fit/energy/energy_pack.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "fit/body/exact_math.hpp"
#include "fit/body/sampling.hpp"

namespace booth::fit {
namespace {

/// The bone that drives each part, in the order of EnergyView::joint's slots.
constexpr std::array<int, kParts> kPartBone{0, 2, 3, 4, 7, 8, 9, 12, 13, 14, 15, 17, 18, 19, 22, 23};
constexpr int kLeftWrist = 15, kRightWrist = 19;  // joints

bool turns(const Bone& b) {
  return std::any_of(b.dof.begin(), b.dof.end(), [](int d) { return d >= 0; });
}

/// C = Z(z) Y(y) X(x) of a bone's axis.
Eigen::Matrix3d axis_frame(const Bone& bone) {
  const auto turn = [&](int axis) {
    const auto [s, c] = exact_sincos(bone.axis_deg[static_cast<std::size_t>(axis)] * std::numbers::pi / 180);
    Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    m(i, i) = m(j, j) = c, m(i, j) = -s, m(j, i) = s;
    return m;
  };
  return turn(2) * turn(1) * turn(0);
}

/// A vertex's parts by rising index, with their weights; bones of one part are joined.
struct Moved {
  int count = 0;
  std::array<int, kVertexParts> part{};
  std::array<float, kVertexParts> weight{};
};

Moved moved_by(const BodyModelData& d, int vertex) {
  std::array<float, kParts> by_part{};
  for (int k = 0; k < kSkinBones; ++k) by_part[static_cast<std::size_t>(part_of_bone(d.skin_bone(k, vertex)))] += d.skin_weight(k, vertex);
  Moved m;
  for (int p = 0; p < kParts; ++p)
    if (const float w = by_part[static_cast<std::size_t>(p)]; w > 0) {
      m.part[static_cast<std::size_t>(m.count)] = p;
      m.weight[static_cast<std::size_t>(m.count++)] = w;
    }
  return m;
}

/// Without the parts whose weight is below kLeastWeight.
void leave_out_small(Moved& m) {
  Moved kept;
  float sum = 0;
  for (int k = 0; k < m.count; ++k) {
    const auto from = static_cast<std::size_t>(k), to = static_cast<std::size_t>(kept.count);
    if (m.weight[from] < kLeastWeight) continue;
    kept.part[to] = m.part[from], sum += kept.weight[to] = m.weight[from];
    ++kept.count;
  }
  for (float& w : kept.weight) w /= sum;
  m = kept;
}

/// Runs of vertices within a batch that the same parts move, and the weights of all but the first part.
void pack_segments(const std::vector<int>& vertex, const std::vector<Moved>& moved, std::vector<float>& weight, std::vector<Segment>& segment,
                   std::vector<std::int32_t>& start) {
  weight.assign(vertex.size() * (kVertexParts - 1), 0);
  for (std::size_t i = 0; i < vertex.size(); ++i) {
    const Moved& m = moved[static_cast<std::size_t>(vertex[i])];
    const std::size_t batch = i / kBatch, lane = i % kBatch;
    if (lane == 0) start.push_back(static_cast<std::int32_t>(segment.size()));
    for (int k = 1; k < m.count; ++k)
      weight[(batch * (kVertexParts - 1) + static_cast<std::size_t>(k) - 1) * kBatch + lane] = m.weight[static_cast<std::size_t>(k)];
    const bool goes_on = lane > 0 && segment.back().count == m.count &&
                         std::equal(m.part.begin(), m.part.begin() + m.count, segment.back().part, [](int a, std::uint8_t b) { return a == b; });
    if (!goes_on) {
      Segment s{static_cast<std::uint8_t>(lane), 0, static_cast<std::uint8_t>(m.count), {}};
      for (int k = 0; k < kVertexParts; ++k) s.part[k] = static_cast<std::uint8_t>(m.part[static_cast<std::size_t>(k)]);
      segment.push_back(s);
    }
    segment.back().end = static_cast<std::uint8_t>(lane + 1);
  }
  start.push_back(static_cast<std::int32_t>(segment.size()));
}

/// Vertices that the same parts move with weights within kSameWeight of each other.
struct Group {
  Moved middle;             ///< of their weights
  std::vector<int> member;  ///< places in EnergyPack::vertex()
};

/// All places, in groups: those of the same parts by rising weight of the first, from each one on as many as may join it.
std::vector<Group> group_by_weights(const std::vector<int>& vertex, const std::vector<Moved>& moved) {
  const auto of = [&](int place) -> const Moved& { return moved[static_cast<std::size_t>(vertex[static_cast<std::size_t>(place)])]; };
  std::vector<int> left(vertex.size());
  std::iota(left.begin(), left.end(), 0);
  std::stable_sort(left.begin(), left.end(),
                   [&](int a, int b) { return std::tie(of(a).count, of(a).part, of(a).weight) < std::tie(of(b).count, of(b).part, of(b).weight); });
  std::vector<Group> groups;
  while (!left.empty()) {
    std::array<float, kVertexParts> low = of(left[0]).weight, high = low;
    const auto joins = [&](int place) {
      const Moved& m = of(place);
      if (m.count != of(left[0]).count || m.part != of(left[0]).part) return false;
      for (std::size_t k = 0; k < kVertexParts; ++k)
        if (std::max(high[k], m.weight[k]) - std::min(low[k], m.weight[k]) > kSameWeight) return false;
      for (std::size_t k = 0; k < kVertexParts; ++k) low[k] = std::min(low[k], m.weight[k]), high[k] = std::max(high[k], m.weight[k]);
      return true;
    };
    Group g{of(left[0]), {}};
    std::vector<int> others;
    for (int place : left) (joins(place) ? g.member : others).push_back(place);
    float sum = 0;
    for (std::size_t k = 0; k < kVertexParts; ++k) sum += g.middle.weight[k] = (low[k] + high[k]) / 2;
    for (float& w : g.middle.weight) w /= sum;
    groups.push_back(std::move(g));
    left = std::move(others);
  }
  return groups;
}

std::uint32_t halves(int low, int high) { return (static_cast<std::uint32_t>(low) & 0xFFFFu) | static_cast<std::uint32_t>(high) << 16; }

}  // namespace

int part_of_bone(int bone) {
  while (!turns(bones()[static_cast<std::size_t>(bone)])) bone = bones()[static_cast<std::size_t>(bone)].parent;
  return static_cast<int>(std::find(kPartBone.begin(), kPartBone.end(), bone) - kPartBone.begin());
}

EnergyPack::EnergyPack(const BodyModel& model, const PosePrior& prior, const EnergyPackSettings& settings)
    : weights_(settings.weights), shape_count_(std::min({settings.shape_count, model.shape_count(), kParticleShape})) {
  if (settings.shape_count < 1 || settings.vertices < kBatch || model.vertex_count() < kBatch)
    throw std::invalid_argument("energy: " + std::to_string(settings.vertices) + " vertices and " + std::to_string(settings.shape_count) +
                                " shape coefficients asked for; give at least " + std::to_string(kBatch) + " and 1");
  order_vertices(model, settings.vertices);
  pack_shapes(model);
  pack_chain(model);
  for (int a = 0; a < kPoseDofs; ++a) pose_mean_.push_back(static_cast<float>(prior.mean[a]));
  for (Eigen::Index c = 0; c < prior.components.cols(); ++c)
    for (int a = 0; a < kPoseDofs; ++a) pose_component_.push_back(static_cast<float>(prior.components(a, c)));
}

void EnergyPack::order_vertices(const BodyModel& model, int count) {
  vertex_ = spread_vertices(model, count);
  vertex_.resize(vertex_.size() / kBatch * kBatch);
  const BodyModelData& d = model.data();
  // Those that the same parts move lie together, and there from the low ones to the high ones.
  std::vector<Moved> moved(static_cast<std::size_t>(model.vertex_count()));
  for (int v : vertex_) moved[static_cast<std::size_t>(v)] = moved_by(d, v);
  const auto key = [&](int v) {
    const Moved& m = moved[static_cast<std::size_t>(v)];
    return std::make_tuple(m.part, m.count, d.mean(1, v), v);
  };
  std::sort(vertex_.begin(), vertex_.end(), [&](int a, int b) { return key(a) < key(b); });

  pack_segments(vertex_, moved, weight_, segment_, segment_start_);
  for (Moved& m : moved) leave_out_small(m);
  for (const Group& g : group_by_weights(vertex_, moved))
    for (std::size_t done = 0; done < g.member.size();) {
      // As many as the batch has room for.
      const std::size_t begin = batch_vertex_.size() % kBatch, end = std::min(begin + g.member.size() - done, static_cast<std::size_t>(kBatch));
      if (begin == 0) batch_segment_start_.push_back(static_cast<std::int32_t>(batch_segment_.size()));
      BatchSegment s{static_cast<std::uint8_t>(begin), static_cast<std::uint8_t>(end), static_cast<std::uint8_t>(g.middle.count), {}, {}};
      for (std::size_t k = 0; k < kVertexParts; ++k) s.part[k] = static_cast<std::uint8_t>(g.middle.part[k]), s.weight[k] = g.middle.weight[k];
      batch_segment_.push_back(s);
      for (std::size_t i = begin; i < end; ++i) batch_vertex_.push_back(g.member[done++]);
    }
  batch_segment_start_.push_back(static_cast<std::int32_t>(batch_segment_.size()));
}

void EnergyPack::pack_shapes(const BodyModel& model) {
  const BodyModelData& d = model.data();
  // [0] the mean, [1 + k] the change for coefficient k: positions and normals of the vertices that are compared.
  std::vector<Eigen::MatrixXd> part(static_cast<std::size_t>(1 + shape_count_), Eigen::MatrixXd(6, vertices()));
  Vertices shaped, normals, other;
  const auto store = [&](int k, const auto& position, const Vertices& normal) {
    for (int i = 0; i < vertices(); ++i)
      for (int c = 0; c < 3; ++c) {
        part[static_cast<std::size_t>(k)](c, i) = static_cast<double>(position(c, vertex_[static_cast<std::size_t>(i)]));
        part[static_cast<std::size_t>(k)](3 + c, i) = static_cast<double>(normal(c, vertex_[static_cast<std::size_t>(i)]));
      }
  };
  vertex_normals(d.mean, d.faces, normals);
  store(0, d.mean, normals);
  for (int k = 0; k < shape_count_; ++k) {
    // Central difference over one standard deviation to either side: the secant that fits real bodies best.
    const auto direction = d.directions.col(k).reshaped(3, model.vertex_count());
    shaped = d.mean + direction;
    vertex_normals(shaped, d.faces, normals);
    shaped = d.mean - direction;
    vertex_normals(shaped, d.faces, other);
    normals = 0.5f * (normals - other);
    store(k + 1, direction, normals);
  }

  // The unit of a group of rows: a direction must fit 16 bits, and the sum at the largest betas 31 bits.
  const auto unit_of = [&](int first_row) {
    double largest = 0, most = 0;
    for (int i = 0; i < vertices(); ++i)
      for (int c = first_row; c < first_row + 3; ++c) {
        double sum = std::abs(part[0](c, i)) / static_cast<double>(kShapeLimit / kShapeSteps);
        for (int k = 1; k <= shape_count_; ++k) {
          const double size = std::abs(part[static_cast<std::size_t>(k)](c, i));
          largest = std::max(largest, size), sum += size;
        }
        most = std::max(most, sum);
      }
    const double per_direction = std::max({largest / 32766, most / 65000, 1e-12});  // in the units of a direction: 1 / kShapeSteps of which is the sum's
    return per_direction / static_cast<double>(kShapeSteps);
  };
  const std::array<double, 2> unit{unit_of(0), unit_of(3)};
  position_unit_ = static_cast<float>(unit[0]);

  const int pairs = (shape_count_ + 1) / 2;
  const std::size_t words = static_cast<std::size_t>((1 + pairs) * 6 * kBatch);
  shape_.assign(words * static_cast<std::size_t>(vertices() / kBatch), 0);
  for (int i = 0; i < vertices(); ++i)
    for (int c = 0; c < 6; ++c) {
      const double u = unit[static_cast<std::size_t>(c / 3)], direction_unit = u * static_cast<double>(kShapeSteps);
      std::int32_t* at = shape_.data() + static_cast<std::size_t>(i / kBatch) * words + static_cast<std::size_t>(c * kBatch + i % kBatch);
      at[0] = static_cast<std::int32_t>(std::lround(part[0](c, i) / u));
      const auto direction = [&](int k) {
        return k < shape_count_ ? static_cast<int>(std::lround(part[static_cast<std::size_t>(1 + k)](c, i) / direction_unit)) : 0;
      };
      for (int p = 0; p < pairs; ++p) at[(1 + p) * 6 * kBatch] = static_cast<std::int32_t>(halves(direction(2 * p), direction(2 * p + 1)));
    }
  pack_batches(part);
}

void EnergyPack::pack_batches(const std::vector<Eigen::MatrixXd>& part) {
  BatchView& b = batch_view_;
  const int on_normals = std::min(kNormalShapes, shape_count_);
  b.quads = (shape_count_ + 3) / 4, b.normal_quads = (on_normals + 3) / 4;
  const auto change = [&](int k) -> const Eigen::MatrixXd& { return part[static_cast<std::size_t>(1 + k)]; };

  // The coefficients that turn the normals most, by rising index; places that are left over name none.
  std::vector<int> order(static_cast<std::size_t>(shape_count_));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int c) { return change(a).bottomRows<3>().squaredNorm() > change(c).bottomRows<3>().squaredNorm(); });
  std::sort(order.begin(), order.begin() + on_normals);
  for (int n = 0; n < on_normals; ++n) b.normal_shape[n] = static_cast<std::uint8_t>(order[static_cast<std::size_t>(n)]);

  // Units: the largest change is kMostByte for a coefficient's step.
  double byte = 1e-12, normal_byte = 1e-12;
  for (int i = 0; i < vertices(); ++i)
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < shape_count_; ++k) byte = std::max(byte, std::abs(change(k)(c, i)));
      for (int n = 0; n < on_normals; ++n) normal_byte = std::max(normal_byte, std::abs(change(b.normal_shape[n])(3 + c, i)));
    }
  const double per_step = static_cast<double>(kByteSteps), unit = byte / kMostByte / per_step, normal_unit = normal_byte / kMostByte / per_step;
  b.position_unit = static_cast<float>(unit), b.normal_unit = static_cast<float>(normal_unit);

  const int words = b.batch_words();
  batch_.assign(static_cast<std::size_t>(words) * static_cast<std::size_t>(vertices() / kBatch), 0);
  for (int i = 0; i < vertices(); ++i)
    for (int c = 0; c < 3; ++c) {
      const int v = batch_vertex_[static_cast<std::size_t>(i)];
      const auto at = [&](int row) -> std::int32_t& {
        return batch_[static_cast<std::size_t>(i / kBatch) * static_cast<std::size_t>(words) + static_cast<std::size_t>(row * kBatch + i % kBatch)];
      };
      // Takes from the mean what the byte, which comes with kByteMiddle steps too many, adds.
      const auto put = [&](int row, int lane, double x, std::int64_t& mean) {
        const auto value = std::lround(x);
        at(row) = static_cast<std::int32_t>(static_cast<std::uint32_t>(at(row)) | (static_cast<std::uint32_t>(value) & 0xFFu) << (8 * lane));
        mean -= kByteMiddle * value;
      };
      std::int64_t mean = std::llround(part[0](c, v) / unit), normal = std::llround(part[0](3 + c, v) / normal_unit);
      for (int k = 0; k < 4 * b.quads; ++k) {
        const int of = k < shape_count_ ? k : k - shape_count_;  // what is left over is the first ones' rest
        if (of < shape_count_)
          put(6 + 3 * (k / 4) + c, k % 4, change(of)(c, v) / (unit * per_step * (k < shape_count_ ? 1.0 : static_cast<double>(kRestSteps))), mean);
      }
      for (int n = 0; n < on_normals; ++n) put(6 + 3 * (b.quads + n / 4) + c, n % 4, change(b.normal_shape[n])(3 + c, v) / (normal_unit * per_step), normal);
      at(c) = static_cast<std::int32_t>(mean), at(3 + c) = static_cast<std::int32_t>(normal);
    }
}

BatchView EnergyPack::batch_view() const {
  BatchView b = batch_view_;
  b.model = view();
  b.segment = batch_segment_.data(), b.segment_start = batch_segment_start_.data();
  b.word = batch_.data();
  return b;
}

void EnergyPack::pack_chain(const BodyModel& model) {
  for (int p = 0; p < kParts; ++p) {
    const int bone = kPartBone[static_cast<std::size_t>(p)];
    const Bone& b = bones()[static_cast<std::size_t>(bone)];
    PartStep step{};
    Eigen::Matrix3d before = Eigen::Matrix3d::Identity(), after = model.rest_rotation(bone).transpose();
    step.parent = -1;
    if (p > 0) {
      const Eigen::Matrix3d frame = axis_frame(b);
      before = model.rest_rotation(b.parent) * frame;
      after = frame.transpose() * model.rest_rotation(bone).transpose();
      step.parent = part_of_bone(b.parent);
    }
    for (int i = 0; i < 9; ++i) step.before[i] = static_cast<float>(before(i / 3, i % 3)), step.after[i] = static_cast<float>(after(i / 3, i % 3));
    for (int a = 0; a < 3; ++a) step.dof[a] = b.dof[static_cast<std::size_t>(a)];
    part_.push_back(step);
  }
  const auto store = [&](const Points3& joints) {
    for (int slot = 0; slot < kPartJoints; ++slot) {
      const int joint = slot < kParts ? start_joint(kPartBone[static_cast<std::size_t>(slot)]) : slot == kParts ? kLeftWrist : kRightWrist;
      for (int c = 0; c < 3; ++c) joint_.push_back(static_cast<float>(joints(c, joint)));
    }
  };
  store(model.rest_joints(ShapeVector()));
  for (int k = 0; k < shape_count_; ++k) store(model.joint_direction(k));
}

EnergyView EnergyPack::view() const {
  EnergyView v;
  v.batches = vertices() / kBatch, v.shape_count = shape_count_, v.pairs = (shape_count_ + 1) / 2;
  v.shape = shape_.data(), v.weight = weight_.data(), v.segment = segment_.data(), v.segment_start = segment_start_.data();
  v.position_unit = position_unit_;
  v.part = part_.data(), v.joint = joint_.data();
  v.pose_mean = pose_mean_.data(), v.pose_component = pose_component_.data();
  v.pose_components = static_cast<std::int32_t>(pose_component_.size()) / kPoseDofs;
  v.point_weight = static_cast<float>(weights_.point), v.plane_weight = static_cast<float>(weights_.plane);
  v.shape_weight = static_cast<float>(weights_.shape), v.bone_weight = static_cast<float>(weights_.bone), v.pose_weight = static_cast<float>(weights_.pose);
  v.data_scale = static_cast<float>(kMillimetres * kPaperVertices / vertices());
  return v;
}

std::size_t EnergyPack::memory_bytes() const {
  return (shape_.size() + batch_.size() + batch_segment_start_.size()) * sizeof(std::int32_t) + batch_vertex_.size() * sizeof(int) +
         batch_segment_.size() * sizeof(BatchSegment) + (weight_.size() + joint_.size() + pose_mean_.size() + pose_component_.size()) * sizeof(float) +
         segment_.size() * sizeof(Segment) + segment_start_.size() * sizeof(std::int32_t) + part_.size() * sizeof(PartStep) + vertex_.size() * sizeof(int);
}

}  // namespace booth::fit
