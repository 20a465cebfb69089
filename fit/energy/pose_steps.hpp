// The way from a particle to its parts' transforms in steps that one thread does in a row or many share: the same operations either way, so the same bits.
#pragma once

#include <cstdint>

#include "fit/energy/energy_view.hpp"
#include "fit/gpu/host_device.hpp"

namespace booth::fit {

/// Coordinate j (0 to 3 kPartJoints - 1) of the resting body's joints (eq. 2).
template <class L>
BOOTH_HOST_DEVICE typename L::F rest_joint_coordinate(const EnergyView& m, const float* particle, std::int64_t stride, int j) {
  typename L::F sum = L::splat(m.joint[j]);
  for (int k = 0; k < m.shape_count; ++k)
    sum = L::multiply_add(L::load(particle + (kParticleDofs + k) * stride), L::splat(m.joint[(1 + k) * (kPartJoints * 3) + j]), sum);
  return sum;
}

/// Eq. 9.
template <class L>
BOOTH_HOST_DEVICE typename L::F shape_term(const EnergyView& m, const float* particle, std::int64_t stride) {
  typename L::F sum = L::splat(0.0f);
  for (int k = 0; k < m.shape_count; ++k) {
    const typename L::F beta = L::load(particle + (kParticleDofs + k) * stride);
    sum = L::multiply_add(beta, beta, sum);
  }
  return sum;
}

/// Eq. 7, in square millimetres.
template <class L>
BOOTH_HOST_DEVICE typename L::F bone_term(const typename L::F* joint) {
  using F = typename L::F;
  F sum = L::splat(0.0f);
  for (int limb = 0; limb < 4; ++limb) {
    F length[2];
    for (int side = 0; side < 2; ++side) {
      const F* from = joint + 3 * limb_slot(limb, 2 * side);
      const F* to = joint + 3 * limb_slot(limb, 2 * side + 1);
      const F x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
      length[side] = L::root((x * x + y * y) + z * z);
    }
    const F difference = (length[0] - length[1]) * 1000.0f;
    sum = sum + difference * difference;
  }
  return sum;
}

/// Angle a, less the prior's mean.
template <class L>
BOOTH_HOST_DEVICE typename L::F angle_from_mean(const EnergyView& m, const float* particle, std::int64_t stride, int a) {
  return L::load(particle + (6 + a) * stride) - m.pose_mean[a];
}

/// The square of the angles' distance from the prior's mean along its component c; away(a) is angle_from_mean().
template <class L, class Away>
BOOTH_HOST_DEVICE typename L::F pose_component_square(const EnergyView& m, const Away& away, int c) {
  typename L::F along = L::splat(0.0f);
  for (int a = 0; a < kParticleAngles; ++a) along = L::multiply_add(away(a), L::splat(m.pose_component[c * kParticleAngles + a]), along);
  return along * along;
}

/// The square of the angles' whole distance from the prior's mean.
template <class L, class Away>
BOOTH_HOST_DEVICE typename L::F pose_square(const Away& away) {
  typename L::F sum = L::splat(0.0f);
  for (int a = 0; a < kParticleAngles; ++a) sum = L::multiply_add(away(a), away(a), sum);
  return sum;
}

/// Eq. 12 from those squares: what of the angles lies outside the subspace. `component` has one value every `stride`.
template <class L>
BOOTH_HOST_DEVICE typename L::F pose_term(typename L::F all, const typename L::F* component, int components, std::int64_t stride) {
  typename L::F inside = L::splat(0.0f);
  for (int c = 0; c < components; ++c) inside = inside + component[c * stride];
  const typename L::F zero = L::splat(0.0f), rest = all - inside;
  return rest > zero ? rest : zero;
}

/// The transform of part p, [3 rows of 4], metres, once its parent's is there. `joint`: the resting joints; `translation`: q[0..2] (used for the root only);
/// turn(dof, sine, cosine) gives an angle's sine and cosine.
template <class L, class Turn>
BOOTH_HOST_DEVICE void place_part(const EnergyView& m, int p, const typename L::F* joint, const typename L::F* parent, const typename L::F* translation,
                                  const Turn& turn, typename L::F* out) {
  using F = typename L::F;
  const PartStep& step = m.part[p];
  F a[9], world[9];
  if (p == 0) {
    for (int i = 0; i < 9; ++i) a[i] = L::splat(i % 4 == 0 ? 1.0f : 0.0f);
  } else {
    F before[9];
    for (int i = 0; i < 9; ++i) before[i] = parent[i / 3 * 4 + i % 3];
    multiply_constant<L>(before, step.before, a);
  }
  F sine, cosine;
  if (p == 0) {  // Y X Z
    turn(step.dof[1], sine, cosine);
    turn_columns<L>(a, 2, 0, sine, cosine);
    turn(step.dof[0], sine, cosine);
    turn_columns<L>(a, 1, 2, sine, cosine);
    turn(step.dof[2], sine, cosine);
    turn_columns<L>(a, 0, 1, sine, cosine);
  } else {  // Z Y X
    if (step.dof[2] >= 0) {
      turn(step.dof[2], sine, cosine);
      turn_columns<L>(a, 0, 1, sine, cosine);
    }
    if (step.dof[1] >= 0) {
      turn(step.dof[1], sine, cosine);
      turn_columns<L>(a, 2, 0, sine, cosine);
    }
    if (step.dof[0] >= 0) {
      turn(step.dof[0], sine, cosine);
      turn_columns<L>(a, 1, 2, sine, cosine);
    }
  }
  multiply_constant<L>(a, step.after, world);
  const F* start = joint + 3 * p;
  for (int row = 0; row < 3; ++row) {
    F place;  // where the part starts, posed
    if (p == 0) {
      place = translation[row];
    } else {
      const F* from = parent + 4 * row;
      place = L::multiply_add(from[1], start[1], from[0] * start[0]) + L::multiply_add(from[2], start[2], from[3]);
      place = place - L::multiply_add(world[3 * row + 2], start[2], L::multiply_add(world[3 * row + 1], start[1], world[3 * row] * start[0]));
    }
    for (int column = 0; column < 3; ++column) out[4 * row + column] = world[3 * row + column];
    out[4 * row + 3] = place;
  }
}

/// A part's transform from metres to what the vertices take: fixed-point resting positions in, cells of the field out.
template <class L, class Field>
BOOTH_HOST_DEVICE void to_cells(const EnergyView& m, const Field& field, typename L::F* transform) {
  const float scale = m.position_unit * field.inverse_cell;
  for (int row = 0; row < 3; ++row) {
    typename L::F* out = transform + 4 * row;
    for (int column = 0; column < 3; ++column) out[column] = out[column] * scale;
    out[3] = (out[3] - field.origin[row]) * field.inverse_cell;
  }
}

}  // namespace booth::fit
