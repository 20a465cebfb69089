// The data terms of the paper's energy as the CPU's vector kernels compute them: what particle_energy.hpp says, in fewer operations.
#pragma once

#include <cstdint>

#include "fit/energy/particle_energy.hpp"

namespace booth::fit {

/// Coefficients in bytes: steps of 1/28 standard deviation, up to 4.5 (127 steps). What they change is in bytes of at most 64: two products of one
/// coefficient's byte (at most 255, with the middle) and one of those then fit the 16 bits to which AVX2 adds them, and a coefficient's rounding, which moves
/// the whole body, weighs more than a vertex's.
inline constexpr float kByteSteps = 28;
inline constexpr int kByteMiddle = 128;
inline constexpr float kMostSteps = 127;
inline constexpr int kMostByte = 64;
inline constexpr float kRestSteps = 8;        ///< places that are left over in the last four hold what the first coefficients are off: 1/8 step of theirs each
inline constexpr int kNormalShapes = 12;      ///< so many coefficients act on the normals: those that turn them most
inline constexpr float kLeastWeight = 0.05f;  ///< parts that move a vertex by less than this are left out, the others take their share
inline constexpr float kSameWeight = 0.08f;   ///< vertices whose parts' weights differ by no more than this share the middle of their weights

/// Consecutive vertices of one batch that move as one: the same parts, about the same weights.
struct BatchSegment {
  std::uint8_t begin, end;  ///< within the batch
  std::uint8_t count;       ///< parts, 1 to kVertexParts
  std::uint8_t part[kVertexParts];
  float weight[kVertexParts];  ///< sum 1
};

/// EnergyView's vertices once more, in an order of their own and rounded for fewer operations: positions to about half a millimetre, normals to about a
/// degree.
///
/// A batch is (6 + 3 (quads + normal_quads)) * kBatch words: the mean's [x y z nx ny nz][vertex]; for each four coefficients the positions' changes as
/// signed bytes, the first in the lowest, [x y z][vertex]; for each four of `normal_shape` the normals' changes likewise, [nx ny nz][vertex].
/// Places of the last four positions' bytes that are left over take what rounding left of the first coefficients. The mean is less kByteMiddle times each
/// byte, as coefficients come with kByteMiddle added.
struct BatchView {
  EnergyView model;
  float position_unit = 1;                ///< m per unit of the batches' positions
  float normal_unit = 1;                  ///< length per unit of the batches' normals; the mean body's are 1 long
  const BatchSegment* segment = nullptr;  ///< as EnergyView's
  const std::int32_t* segment_start = nullptr;
  const std::int32_t* word = nullptr;
  std::int32_t quads = 0, normal_quads = 0;
  std::uint8_t normal_shape[kNormalShapes] = {};  ///< coefficients

  BOOTH_HOST_DEVICE std::int32_t batch_words() const { return (6 + 3 * (quads + normal_quads)) * kBatch; }
};

/// A particle's coefficients as the batches take them.
template <class L>
struct PackedShape {
  typename L::I quad[kParticleShape / 4], normal[kNormalShapes / 4];
};

template <class L>
BOOTH_HOST_DEVICE void pack_batch_shape(const BatchView& b, const float* particle, std::int64_t stride, PackedShape<L>& out) {
  using F = typename L::F;
  using I = typename L::I;
  I byte[kParticleShape];
  F rest[3];
  const auto whole = [&](F x, I& out_byte) {
    I bits;
    const F nearest = rounded<L>(L::smaller(L::larger(x, L::splat(-kMostSteps)), L::splat(kMostSteps)), bits);
    out_byte = bits + kByteMiddle;
    return nearest;
  };
  const int count = b.model.shape_count;
  for (int k = 0; k < count; ++k) {
    const F scaled = L::load(particle + (kParticleDofs + k) * stride) * kByteSteps, off = scaled - whole(scaled, byte[k]);
    if (k < 3) rest[k] = off * kRestSteps;
  }
  for (int k = count; k < 4 * b.quads; ++k) {
    byte[k] = L::splat(std::int32_t{0});
    if (k - count < count) whole(rest[k - count], byte[k]);
  }
  const auto four = [&](int k0, int k1, int k2, int k3) { return byte[k0] | byte[k1] << 8 | byte[k2] << 16 | byte[k3] << 24; };
  for (int q = 0, k = 0; q < b.quads; ++q, k += 4) out.quad[q] = four(k, k + 1, k + 2, k + 3);
  for (int q = 0; q < b.normal_quads; ++q) {
    const std::uint8_t* k = b.normal_shape + 4 * q;
    out.normal[q] = four(k[0], k[1], k[2], k[3]);
  }
}

/// What a batch's vertices are on their way: positions from their cells' centres, normals of any length, and where to look.
template <class L>
struct PosedBatch {
  typename L::F position[kBatch][3], normal[kBatch][3];
  std::int32_t cell[kBatch][L::kCount];
};

/// Rest position and pose of the i-th vertex, which the rigid or blended transform `m` moves.
template <class L, int kQuads>
BOOTH_HOST_DEVICE void pose_vertex(const BatchView& b, const CellView& field, const std::int32_t* word, const typename L::F* m, const PackedShape<L>& shape,
                                   int i, PosedBatch<L>& out) {
  using F = typename L::F;
  using I = typename L::I;
  // kQuads > 0: how many fours of positions, with all fours of normals.
  const int quads = kQuads > 0 ? kQuads : b.quads, normal_quads = kQuads > 0 ? kNormalShapes / 4 : b.normal_quads;
  I sum[6];
  const std::int32_t* at = word + i;
  for (int c = 0; c < 6; ++c) sum[c] = L::splat(at[c * kBatch]);
  at += 6 * kBatch;
  for (int q = 0; q < quads; ++q, at += 3 * kBatch)
    for (int c = 0; c < 3; ++c) sum[c] = L::quad_dot(sum[c], shape.quad[q], L::splat(at[c * kBatch]));
  for (int q = 0; q < normal_quads; ++q, at += 3 * kBatch)
    for (int c = 0; c < 3; ++c) sum[3 + c] = L::quad_dot(sum[3 + c], shape.normal[q], L::splat(at[c * kBatch]));
  F rest[6], posed[3];
  for (int c = 0; c < 6; ++c) rest[c] = L::to_float(sum[c]);
  for (int row = 0; row < 3; ++row, m += 4) {
    posed[row] = L::multiply_add(m[0], rest[0], L::multiply_add(m[1], rest[1], L::multiply_add(m[2], rest[2], m[3])));
    out.normal[i][row] = L::multiply_add(m[0], rest[3], L::multiply_add(m[1], rest[4], m[2] * rest[5]));
  }
  L::store(out.cell[i], locate<L>(field, posed[0], posed[1], posed[2]));
  for (int c = 0; c < 3; ++c) out.position[i][c] = posed[c];
}

template <class L, int kQuads>
BOOTH_HOST_DEVICE void pose_segment(const BatchView& b, const CellView& field, const std::int32_t* word, const BatchSegment& s,
                                    const typename L::F (*transform)[12], const PackedShape<L>& shape, PosedBatch<L>& out) {
  const typename L::F* moved_by = transform[s.part[0]];
  typename L::F blended[12];
  if (s.count > 1) {
    for (int e = 0; e < 12; ++e) blended[e] = moved_by[e] * s.weight[0];
    for (int k = 1; k < s.count; ++k)
      for (int e = 0; e < 12; ++e) blended[e] = L::multiply_add(transform[s.part[k]][e], L::splat(s.weight[k]), blended[e]);
    moved_by = blended;
  }
  // One vertex at a time: two share what they load, but spill more than that.
  for (int i = s.begin; i < s.end; ++i) pose_vertex<L, kQuads>(b, field, word, moved_by, shape, i, out);
}

/// x^-1/2 as a parabola through 0.66, 0.97 and 1.06, for the squared length of a normal: 0.03 % from 0.96 to 1.07, where shapes and blends leave nearly all of
/// them, 0.3 % from 0.63 to 1.15.
inline constexpr float kRootParabola[3] = {2.0192963f, -1.5341331f, 0.5145700f};

/// The same for posed normals as the batches have them: a transform multiplies their units by position_unit / cell_size.
struct NormalScale {
  float length, parabola[3];  ///< plane distances are cells / length

  BOOTH_HOST_DEVICE NormalScale(const BatchView& b, const CellView& field) : length(b.normal_unit / b.position_unit * field.cell_size) {
    const float square = length * length;
    parabola[0] = kRootParabola[0], parabola[1] = kRootParabola[1] * square, parabola[2] = kRootParabola[2] * square * square;
  }
};

/// Adds the data terms of a batch: point in cells, plane in cells / normals.length.
template <class L, int kQuads>
BOOTH_HOST_DEVICE void batch_distances(const BatchView& b, const CellView& field, const NormalScale& normals, int batch, const typename L::F (*transform)[12],
                                       const PackedShape<L>& shape, typename L::F& point, typename L::F& plane) {
  using F = typename L::F;
  const std::int32_t* word = b.word + static_cast<std::int64_t>(batch) * b.batch_words();
  // Step by step for the whole batch, so that loads find their addresses long computed.
  PosedBatch<L> posed;
  for (int s = b.segment_start[batch]; s < b.segment_start[batch + 1]; ++s) pose_segment<L, kQuads>(b, field, word, b.segment[s], transform, shape, posed);
  const F charged = L::splat(kChargedOutside * field.inverse_cell), charged_plane = charged * (1 / normals.length);
  for (int i = 0; i < kBatch; ++i) {
    F x = posed.position[i][0], y = posed.position[i][1], z = posed.position[i][2];
    const auto outside = subtract_nearest<L>(L::gather(field.middle, posed.cell[i]), x, y, z);
    const F* n = posed.normal[i];
    const F along = L::multiply_add(n[0], x, L::multiply_add(n[1], y, n[2] * z));
    const F length2 = L::multiply_add(n[0], n[0], L::multiply_add(n[1], n[1], n[2] * n[2]));
    const F inverse_length =
        L::multiply_add(L::multiply_add(L::splat(normals.parabola[2]), length2, L::splat(normals.parabola[1])), length2, L::splat(normals.parabola[0]));
    const F distance2 = L::multiply_add(x, x, L::multiply_add(y, y, z * z));
    point = point + (outside ? charged : L::root(distance2));
    plane = plane + (outside ? charged_plane : L::absolute(along) * inverse_length);
  }
}

/// So many particles are evaluated together, batch by batch: what one of them has called into the caches of model and field the next ones find there.
inline constexpr int kTogether = 128;

/// The whole energy of up to kTogether particles, L::kCount at a time; particle(u) is where those of turn u begin, done(u, terms) takes what they cost.
template <class L, int kQuads, class Particle, class Done>
BOOTH_HOST_DEVICE void particle_energies(const BatchView& b, const CellView& field, int turns, std::int64_t stride, const Particle& particle,
                                         const Done& done) {
  constexpr int kTurns = kTogether / L::kCount;
  typename L::F transform[kTurns][kParts][12], point[kTurns], plane[kTurns];
  PackedShape<L> shape[kTurns];
  LaneTerms<L> terms[kTurns];
  EnergyView model = b.model;
  model.position_unit = b.position_unit;
  const NormalScale normals(b, field);
  for (int u = 0; u < turns; ++u) {
    pose_particle<L>(model, field, particle(u), stride, transform[u], terms[u]);
    pack_batch_shape<L>(b, particle(u), stride, shape[u]);
    point[u] = plane[u] = L::splat(0.0f);
  }
  for (int batch = 0; batch < b.model.batches; ++batch)
    for (int u = 0; u < turns; ++u) batch_distances<L, kQuads>(b, field, normals, batch, transform[u], shape[u], point[u], plane[u]);
  const float scale = b.model.data_scale * field.cell_size;
  for (int u = 0; u < turns; ++u) {
    terms[u].point = point[u] * scale, terms[u].plane = plane[u] * (normals.length * scale);
    done(u, terms[u]);
  }
}

}  // namespace booth::fit
