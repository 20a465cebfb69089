// The paper's energy (eq. 4-13) of one particle over packed model data: single-source, for the CPU's kernels, the scalar reference and a device.
#pragma once

#include <cstdint>

#include "fit/cloud/field_view.hpp"
#include "fit/host_device.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit {

inline constexpr int kBatch = 16;               ///< vertices whose data lies side by side
inline constexpr int kParts = 16;               ///< rigid parts: the root and the 15 bones that turn; the other bones move with the one before them
inline constexpr int kPartJoints = 18;          ///< rest joints that a particle needs: where the parts start (the root's is 0), and the two wrists
inline constexpr int kVertexParts = 4;          ///< most parts that move one vertex
inline constexpr int kParticleShape = 64;       ///< most shape coefficients
inline constexpr int kParticleDofs = 36;        ///< length of q
inline constexpr int kParticleAngles = 30;      ///< joint angles, which have the pose prior
inline constexpr float kShapeSteps = 2048;      ///< fixed point of beta among the vertices: steps per standard deviation
inline constexpr float kShapeLimit = 32767;     ///< ... and its largest magnitude, just below 16 standard deviations
inline constexpr float kChargedOutside = 0.3f;  ///< m; what a vertex off the field's band is charged with, as distance and as plane distance

/// One part of the kinematic chain: A = A_parent * before * R * after, where R = Z(q[dof 2]) Y(q[dof 1]) X(q[dof 0]) (the root: R = Y X Z).
/// A takes the resting body's directions to the posed body's.
struct PartStep {
  float before[9], after[9];  ///< row by row
  std::int32_t parent;        ///< part, before this one; -1 for the root
  std::int32_t dof[3];        ///< q index of the turns about x, y, z; -1 for none
};

/// Consecutive vertices of one batch that the same parts move.
struct Segment {
  std::uint8_t begin, end;  ///< within the batch
  std::uint8_t count;       ///< parts, 1 to kVertexParts
  std::uint8_t part[kVertexParts];
};

/// Flat view of a model as the energy needs it (fit/energy/energy_pack.hpp makes it). Metres; CMU frame.
///
/// Rest positions and normals are fixed-point sums: mean + sum_k direction_k * round(beta_k * kShapeSteps), 32 bits, which no beta can overflow: exact, so
/// that any order of summation gives the same bits. A batch is (1 + pairs) * 6 * kBatch words: the mean's [x y z nx ny nz][vertex], then
/// for each pair of coefficients [x y z nx ny nz][vertex] with the even coefficient's direction in the low half and the odd one's in the high half.
struct EnergyView {
  std::int32_t batches = 0, shape_count = 0, pairs = 0;
  const std::int32_t* shape = nullptr;
  const float* weight = nullptr;                ///< [batch][kVertexParts - 1][vertex]: of the segment's second to fourth part; the first has the rest
  const Segment* segment = nullptr;             ///< those of batch b are segment_start[b] to segment_start[b + 1]
  const std::int32_t* segment_start = nullptr;  ///< batches + 1
  float position_unit = 1;                      ///< m per unit of the fixed-point positions; the normals' unit does not matter
  const PartStep* part = nullptr;               ///< kParts
  const float* joint = nullptr;                 ///< [1 + shape_count][kPartJoints * 3]: mean, then the change for each coefficient
  const float* pose_mean = nullptr;             ///< kParticleAngles
  const float* pose_component = nullptr;        ///< [pose_components][kParticleAngles]
  std::int32_t pose_components = 0;
  float point_weight = 1, plane_weight = 3, shape_weight = 1e3f, bone_weight = 0.03f, pose_weight = 10;
  float data_scale = 1;  ///< from metres summed over the vertices to millimetres summed over 1,000

  BOOTH_HOST_DEVICE std::int32_t batch_words() const { return (1 + pairs) * 6 * kBatch; }
  BOOTH_HOST_DEVICE std::int32_t dimensions() const { return kParticleDofs + shape_count; }
};

/// Unweighted terms; data terms in millimetres summed over 1,000 vertices.
struct ParticleTerms {
  float point, plane, shape, bone, pose;
};

/// The left and right segments that eq. 7 compares, as pairs of slots of EnergyView::joint (slot s is where part s starts; 16 and 17 are the wrists).
/// Thigh, shank, upper arm, forearm: from, to (left), from, to (right).
BOOTH_HOST_DEVICE int limb_slot(int limb, int end) {
  constexpr int kSlots[4][4] = {{1, 2, 4, 5}, {2, 3, 5, 6}, {9, 10, 12, 13}, {10, 16, 13, 17}};
  return kSlots[limb][end];
}

/// Nearest integer (ties to even) of |x| < 2^22, as a float, and its bits below the exponent.
template <class L>
BOOTH_HOST_DEVICE typename L::F rounded(typename L::F x, typename L::I& bits) {
  constexpr float kMagic = 12582912.0f;  // 1.5 * 2^23: adding it pushes the fraction out of the mantissa
  const typename L::F shifted = x + kMagic;
  bits = L::as_int(shifted) - 0x4B400000;
  return shifted - kMagic;
}

/// Sine and cosine for |x| < 1000, to 1.5e-7: own polynomials, since every C library and every device has others.
template <class L>
BOOTH_HOST_DEVICE void sine_cosine(typename L::F x, typename L::F& sine, typename L::F& cosine) {
  using F = typename L::F;
  typename L::I quadrant;
  const F n = rounded<L>(x * 0.636619772f, quadrant);
  const F r = ((x - n * 1.5703125f) - n * 4.837512969970703125e-4f) - n * 7.549789954891882e-8f;
  const F z = r * r;
  const F s = r + r * (z * (((z * -1.9515295891e-4f + 8.3321608736e-3f) * z) - 1.6666654611e-1f));
  const F c = (z * z) * ((z * 2.443315711809948e-5f - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) - z * 0.5f + 1.0f;
  const auto odd = (quadrant & 1) != L::splat(std::int32_t{0});
  const F a = odd ? c : s, b = odd ? s : c;
  // Negative sines in quadrants 2 and 3, negative cosines in 1 and 2.
  sine = L::as_float(L::as_int(a) ^ ((quadrant & 2) << 30));
  cosine = L::as_float(L::as_int(b) ^ (((quadrant + 1) & 2) << 30));
}

/// out = a * m, 3 x 3, row by row; m is the same for all lanes.
template <class L>
BOOTH_HOST_DEVICE void multiply_constant(const typename L::F (&a)[9], const float (&m)[9], typename L::F (&out)[9]) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      out[3 * row + column] = (a[3 * row] * m[column] + a[3 * row + 1] * m[3 + column]) + a[3 * row + 2] * m[6 + column];
}

/// Turns columns i and j of a into each other: a = a * (rotation that takes axis i towards axis j).
template <class L>
BOOTH_HOST_DEVICE void turn_columns(typename L::F (&a)[9], int i, int j, typename L::F sine, typename L::F cosine) {
  for (int row = 0; row < 3; ++row) {
    const typename L::F first = a[3 * row + i], second = a[3 * row + j];
    a[3 * row + i] = first * cosine + second * sine;
    a[3 * row + j] = second * cosine - first * sine;
  }
}

/// The rigid transforms of a particle's parts, [part][3 rows of 4], and what the priors cost (unweighted; terms.point and .plane are left alone).
/// `particle` has one value every `stride` floats: q, then beta. `transform` takes resting positions in FIXED-POINT UNITS to cells of the field: its
/// three columns are scaled by position_unit / cell_size, its fourth is in cells from the field's origin.
template <class L, class Terms>
BOOTH_HOST_DEVICE void pose_particle(const EnergyView& m, const FieldView& field, const float* particle, std::int64_t stride, typename L::F (*transform)[12],
                                     Terms& terms) {
  using F = typename L::F;
  const F zero = L::splat(0.0f);

  // Joints of the resting body (eq. 2), and eq. 9.
  F joint[kPartJoints * 3];
  for (int j = 0; j < kPartJoints * 3; ++j) joint[j] = L::splat(m.joint[j]);
  F shape = zero;
  for (int k = 0; k < m.shape_count; ++k) {
    const F beta = L::load(particle + (kParticleDofs + k) * stride);
    const float* direction = m.joint + (1 + k) * (kPartJoints * 3);
    for (int j = 0; j < kPartJoints * 3; ++j) joint[j] = joint[j] + beta * direction[j];
    shape = shape + beta * beta;
  }
  terms.shape = shape;

  // Eq. 7, in square millimetres.
  F bone = zero;
  for (int limb = 0; limb < 4; ++limb) {
    F length[2];
    for (int side = 0; side < 2; ++side) {
      const F* from = joint + 3 * limb_slot(limb, 2 * side);
      const F* to = joint + 3 * limb_slot(limb, 2 * side + 1);
      const F x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
      length[side] = L::root((x * x + y * y) + z * z);
    }
    const F difference = (length[0] - length[1]) * 1000.0f;
    bone = bone + difference * difference;
  }
  terms.bone = bone;

  // Eq. 12: what of the angles lies outside the subspace.
  F away[kParticleAngles];
  F all = zero, inside = zero;
  for (int a = 0; a < kParticleAngles; ++a) {
    away[a] = L::load(particle + (6 + a) * stride) - m.pose_mean[a];
    all = all + away[a] * away[a];
  }
  for (int c = 0; c < m.pose_components; ++c) {
    F along = zero;
    for (int a = 0; a < kParticleAngles; ++a) along = along + away[a] * m.pose_component[c * kParticleAngles + a];
    inside = inside + along * along;
  }
  const F rest = all - inside;
  terms.pose = rest > zero ? rest : zero;

  // The chain, in metres first.
  for (int p = 0; p < kParts; ++p) {
    const PartStep& step = m.part[p];
    F a[9], world[9];
    if (p == 0) {
      for (int i = 0; i < 9; ++i) a[i] = L::splat(i % 4 == 0 ? 1.0f : 0.0f);
    } else {
      F parent[9];
      for (int i = 0; i < 9; ++i) parent[i] = transform[step.parent][i / 3 * 4 + i % 3];
      multiply_constant<L>(parent, step.before, a);
    }
    F sine, cosine;
    const auto turn = [&](int axis) {
      if (step.dof[axis] < 0) return;
      sine_cosine<L>(L::load(particle + step.dof[axis] * stride), sine, cosine);
      turn_columns<L>(a, (axis + 1) % 3, (axis + 2) % 3, sine, cosine);
    };
    if (p == 0) {
      turn(1), turn(0), turn(2);
    } else {
      turn(2), turn(1), turn(0);
    }
    multiply_constant<L>(a, step.after, world);
    F* out = transform[p];
    const F* start = joint + 3 * p;
    for (int row = 0; row < 3; ++row) {
      F place;  // where the part starts, posed
      if (p == 0) {
        place = L::load(particle + row * stride);
      } else {
        const F* parent = transform[step.parent] + 4 * row;
        place = (parent[0] * start[0] + parent[1] * start[1]) + (parent[2] * start[2] + parent[3]);
        place = place - ((world[3 * row] * start[0] + world[3 * row + 1] * start[1]) + world[3 * row + 2] * start[2]);
      }
      for (int column = 0; column < 3; ++column) out[4 * row + column] = world[3 * row + column];
      out[4 * row + 3] = place;
    }
  }
  const float scale = m.position_unit * field.inverse_cell;
  for (int p = 0; p < kParts; ++p)
    for (int row = 0; row < 3; ++row) {
      F* out = transform[p] + 4 * row;
      for (int column = 0; column < 3; ++column) out[column] = out[column] * scale;
      out[3] = (out[3] - field.origin[row]) * field.inverse_cell;
    }
}

/// Beta in fixed point, two coefficients a word: what the vertices take.
template <class L>
BOOTH_HOST_DEVICE void pack_shape(const EnergyView& m, const float* particle, std::int64_t stride, typename L::I* pair) {
  using F = typename L::F;
  using I = typename L::I;
  const auto fixed = [&](int k) {
    if (k >= m.shape_count) return L::splat(std::int32_t{0});
    F b = L::load(particle + (kParticleDofs + k) * stride) * kShapeSteps;
    b = b < L::splat(kShapeLimit) ? b : L::splat(kShapeLimit);
    b = b > L::splat(-kShapeLimit) ? b : L::splat(-kShapeLimit);
    I bits;
    rounded<L>(b, bits);
    return bits;
  };
  for (int p = 0; p < m.pairs; ++p) pair[p] = (fixed(2 * p) & 0xFFFF) | fixed(2 * p + 1) << 16;
}

/// Rest position and normal (x y z nx ny nz, fixed-point units) of a batch's vertex; eq. 1 and the normal's first-order change. `shape` is the batch's data
/// at the vertex. kPairs > 0 fixes the number of pairs at compile time.
template <class L, int kPairs>
BOOTH_HOST_DEVICE void rest_vertex(const std::int32_t* shape, const typename L::I* pair, int pairs, typename L::F (&out)[6]) {
  typename L::I sum[6];
  for (int c = 0; c < 6; ++c) sum[c] = L::splat(shape[c * kBatch]);
  const int count = kPairs > 0 ? kPairs : pairs;
  for (int p = 0; p < count; ++p)
    for (int c = 0; c < 6; ++c) sum[c] = L::pair_dot(sum[c], pair[p], L::splat(shape[((1 + p) * 6 + c) * kBatch]));
  for (int c = 0; c < 6; ++c) out[c] = L::to_float(sum[c]);
}

/// The blended transform of a vertex: that of the first part, plus each further part's difference from it by the part's weight.
/// `weight` is the batch's at the vertex.
template <class L>
BOOTH_HOST_DEVICE void blend_transforms(const typename L::F (*transform)[12], const Segment& s, const float* weight, typename L::F (&out)[12]) {
  const typename L::F* first = transform[s.part[0]];
  for (int i = 0; i < 12; ++i) out[i] = first[i];
  for (int k = 1; k < s.count; ++k) {
    const typename L::F* other = transform[s.part[k]];
    const float w = weight[(k - 1) * kBatch];
    for (int i = 0; i < 12; ++i) out[i] = out[i] + (other[i] - first[i]) * w;
  }
}

/// Posed position (cells) and normal (any length).
template <class L>
BOOTH_HOST_DEVICE void pose_vertex(const typename L::F (&t)[12], const typename L::F (&rest)[6], typename L::F (&out)[6]) {
  for (int row = 0; row < 3; ++row) {
    out[row] = (t[4 * row] * rest[0] + t[4 * row + 1] * rest[1]) + (t[4 * row + 2] * rest[2] + t[4 * row + 3]);
    out[3 + row] = (t[4 * row] * rest[3] + t[4 * row + 1] * rest[4]) + t[4 * row + 2] * rest[5];
  }
}

/// One vertex's shares of eq. 5 and 6, in cells: its distance from the nearest cloud point and that distance along the model's normal.
/// `v` is the difference from the nearest point and the normal.
template <class L, class Mask>
BOOTH_HOST_DEVICE void vertex_distances(const FieldView& field, const typename L::F (&v)[6], Mask outside, typename L::F& point, typename L::F& plane) {
  using F = typename L::F;
  const F along = (v[3] * v[0] + v[4] * v[1]) + v[5] * v[2];
  const F length2 = (v[3] * v[3] + v[4] * v[4]) + v[5] * v[5] + 1e-12f;
  const F charged = L::splat(kChargedOutside * field.inverse_cell);
  point = outside ? charged : L::root((v[0] * v[0] + v[1] * v[1]) + v[2] * v[2]);
  plane = outside ? charged : L::absolute(along) / L::root(length2);
}

/// Data terms of a batch in cells: its vertices' shares summed in their order.
template <class L, int kPairs>
BOOTH_HOST_DEVICE void batch_distances(const EnergyView& m, const FieldView& field, int batch, const typename L::F (*transform)[12], const typename L::I* pair,
                                       typename L::F& point, typename L::F& plane) {
  using F = typename L::F;
  const std::int32_t* shape = m.shape + static_cast<std::int64_t>(batch) * m.batch_words();
  const float* weight = m.weight + static_cast<std::int64_t>(batch) * ((kVertexParts - 1) * kBatch);
  // Step by step for the whole batch: each step's chains of dependent operations are short, so that a processor finds enough to do at once, and no load
  // waits for a store that was just made.
  F posed[kBatch][6];
  std::int32_t at[kBatch][L::kCount], local[kBatch][L::kCount];
  for (int s = m.segment_start[batch]; s < m.segment_start[batch + 1]; ++s) {
    const Segment& segment = m.segment[s];
    for (int i = segment.begin; i < segment.end; ++i) {
      F rest[6], blended[12];
      rest_vertex<L, kPairs>(shape + i, pair, m.pairs, rest);
      blend_transforms<L>(transform, segment, weight + i, blended);
      pose_vertex<L>(blended, rest, posed[i]);
    }
  }
  for (int i = 0; i < kBatch; ++i) {
    typename L::I brick, cell;
    locate<L>(field, posed[i][0], posed[i][1], posed[i][2], brick, cell);
    L::store(at[i], brick), L::store(local[i], cell);
  }
  for (int i = 0; i < kBatch; ++i) L::store(at[i], cell_of<L>(L::gather(field.brick, at[i]), L::load(local[i])));
  point = plane = L::splat(0.0f);
  for (int i = 0; i < kBatch; ++i) {
    F a, b;
    const auto outside = subtract_nearest<L>(field, L::gather(field.cell, at[i]), posed[i][0], posed[i][1], posed[i][2]);
    vertex_distances<L>(field, posed[i], outside, a, b);
    point = point + a, plane = plane + b;
  }
}

/// Eq. 4 from unweighted terms.
template <class L, class Terms>
BOOTH_HOST_DEVICE auto total_energy(const EnergyView& m, const Terms& t) {
  return (t.point * m.point_weight + t.plane * m.plane_weight) + (t.shape * m.shape_weight + t.bone * m.bone_weight) + t.pose * m.pose_weight;
}

/// Terms of one lane set: ParticleTerms for vectors.
template <class L>
struct LaneTerms {
  typename L::F point, plane, shape, bone, pose;
};

/// The whole energy of a particle (one a lane). The reference order of summation: a batch's vertices, then the batches.
template <class L, int kPairs>
BOOTH_HOST_DEVICE void particle_energy(const EnergyView& m, const FieldView& field, const float* particle, std::int64_t stride, LaneTerms<L>& terms) {
  typename L::F transform[kParts][12];
  typename L::I pair[kParticleShape / 2];
  pose_particle<L>(m, field, particle, stride, transform, terms);
  pack_shape<L>(m, particle, stride, pair);
  typename L::F point = L::splat(0.0f), plane = L::splat(0.0f);
  for (int b = 0; b < m.batches; ++b) {
    typename L::F batch_point, batch_plane;
    batch_distances<L, kPairs>(m, field, b, transform, pair, batch_point, batch_plane);
    point = point + batch_point, plane = plane + batch_plane;
  }
  const float scale = m.data_scale * field.cell_size;
  terms.point = point * scale, terms.plane = plane * scale;
}

}  // namespace booth::fit
