// The flat model that the paper's energy is evaluated on, and the arithmetic that its steps share: single-source, for the CPU's kernels and a device.
#pragma once

#include <cstdint>

#include "fit/gpu/host_device.hpp"
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
  const auto add = [](F a, float b, F c) { return L::multiply_add(a, L::splat(b), c); };
  const F r = add(n, -7.549789954891882e-8f, add(n, -4.837512969970703125e-4f, add(n, -1.5703125f, x)));
  const F z = r * r;
  const F odd_terms = L::multiply_add(add(z, -1.9515295891e-4f, L::splat(8.3321608736e-3f)), z, L::splat(-1.6666654611e-1f));
  const F even_terms = L::multiply_add(add(z, 2.443315711809948e-5f, L::splat(-1.388731625493765e-3f)), z, L::splat(4.166664568298827e-2f));
  const F s = L::multiply_add(r, z * odd_terms, r);
  const F c = L::multiply_add(z * z, even_terms, z * -0.5f) + 1.0f;
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
      out[3 * row + column] =
          L::multiply_add(a[3 * row + 2], L::splat(m[6 + column]), L::multiply_add(a[3 * row + 1], L::splat(m[3 + column]), a[3 * row] * m[column]));
}

/// Turns columns i and j of a into each other: a = a * (rotation that takes axis i towards axis j).
template <class L>
BOOTH_HOST_DEVICE void turn_columns(typename L::F (&a)[9], int i, int j, typename L::F sine, typename L::F cosine) {
  for (int row = 0; row < 3; ++row) {
    const typename L::F first = a[3 * row + i], second = a[3 * row + j];
    a[3 * row + i] = L::multiply_add(first, cosine, second * sine);
    a[3 * row + j] = L::multiply_add(second, cosine, first * -sine);
  }
}

}  // namespace booth::fit
