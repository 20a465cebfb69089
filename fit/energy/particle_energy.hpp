// The paper's energy (eq. 4-13) of one particle over packed model data: single-source, for the scalar reference, the vector kernels' chain and a device.
#pragma once

#include <cstdint>

#include "fit/cloud/cell_view.hpp"
#include "fit/energy/energy_view.hpp"
#include "fit/energy/pose_steps.hpp"
#include "fit/gpu/host_device.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit {

/// The rigid transforms of a particle's parts, [part][3 rows of 4], and what the priors cost (unweighted; terms.point and .plane are left alone).
/// `particle` has one value every `stride` floats: q, then beta. `transform` takes resting positions in FIXED-POINT UNITS to cells of the field: its
/// three columns are scaled by position_unit / cell_size, its fourth is in cells from the field's origin.
template <class L, class Field, class Terms>
BOOTH_HOST_DEVICE void pose_particle(const EnergyView& m, const Field& field, const float* particle, std::int64_t stride, typename L::F (*transform)[12],
                                     Terms& terms) {
  using F = typename L::F;
  F joint[kPartJoints * 3];
  for (int j = 0; j < kPartJoints * 3; ++j) joint[j] = rest_joint_coordinate<L>(m, particle, stride, j);
  terms.shape = shape_term<L>(m, particle, stride);
  terms.bone = bone_term<L>(joint);

  F away[kParticleAngles], inside = L::splat(0.0f);
  for (int a = 0; a < kParticleAngles; ++a) away[a] = angle_from_mean<L>(m, particle, stride, a);
  const auto away_at = [&](int a) { return away[a]; };
  for (int c = 0; c < m.pose_components; ++c) inside = inside + pose_component_square<L>(m, away_at, c);
  terms.pose = pose_term<L>(pose_square<L>(away_at), &inside, 1, 1);

  const F translation[3] = {L::load(particle), L::load(particle + stride), L::load(particle + 2 * stride)};
  const auto turn = [&](int dof, F& sine, F& cosine) { sine_cosine<L>(L::load(particle + dof * stride), sine, cosine); };
  // In metres first: a part needs its parent's.
  for (int p = 0; p < kParts; ++p) place_part<L>(m, p, joint, p == 0 ? nullptr : transform[m.part[p].parent], translation, turn, transform[p]);
  for (int p = 0; p < kParts; ++p) to_cells<L>(m, field, transform[p]);
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
template <class L, class Field, class Mask>
BOOTH_HOST_DEVICE void vertex_distances(const Field& field, const typename L::F (&v)[6], Mask outside, typename L::F& point, typename L::F& plane) {
  using F = typename L::F;
  const F along = (v[3] * v[0] + v[4] * v[1]) + v[5] * v[2];
  const F length2 = (v[3] * v[3] + v[4] * v[4]) + v[5] * v[5] + 1e-12f;
  const F charged = L::splat(kChargedOutside * field.inverse_cell);
  point = outside ? charged : L::root((v[0] * v[0] + v[1] * v[1]) + v[2] * v[2]);
  plane = outside ? charged : L::absolute(along) / L::root(length2);
}

/// Data terms of a batch in cells: its vertices' shares summed in their order.
template <class L, int kPairs, class Field>
BOOTH_HOST_DEVICE void batch_distances(const EnergyView& m, const Field& field, int batch, const typename L::F (*transform)[12], const typename L::I* pair,
                                       typename L::F& point, typename L::F& plane) {
  using F = typename L::F;
  const std::int32_t* shape = m.shape + static_cast<std::int64_t>(batch) * m.batch_words();
  const float* weight = m.weight + static_cast<std::int64_t>(batch) * ((kVertexParts - 1) * kBatch);
  point = plane = L::splat(0.0f);
  for (int s = m.segment_start[batch]; s < m.segment_start[batch + 1]; ++s) {
    const Segment& segment = m.segment[s];
    for (int i = segment.begin; i < segment.end; ++i) {
      F rest[6], blended[12], posed[6], a, b;
      rest_vertex<L, kPairs>(shape + i, pair, m.pairs, rest);
      blend_transforms<L>(transform, segment, weight + i, blended);
      pose_vertex<L>(blended, rest, posed);
      const auto outside = field_difference<L>(field, posed[0], posed[1], posed[2]);
      vertex_distances<L>(field, posed, outside, a, b);
      point = point + a, plane = plane + b;
    }
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
template <class L, int kPairs, class Field>
BOOTH_HOST_DEVICE void particle_energy(const EnergyView& m, const Field& field, const float* particle, std::int64_t stride, LaneTerms<L>& terms) {
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
