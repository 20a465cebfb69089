// A kernel of the swarm: particles side by side in vectors; compiled once for each instruction set.
#include "fit/swarm/swarm_group.hpp"
#include "fit/swarm/vector_lanes.hpp"

#if !defined(BOOTH_SWARM_KERNEL) || !defined(BOOTH_SWARM_LANES)
#error "BOOTH_SWARM_KERNEL must name the function (e.g. run_avx2) and BOOTH_SWARM_LANES the particles in a vector"
#endif

namespace booth::fit {

void BOOTH_SWARM_KERNEL(const SwarmWork& work, int first, int last);
void BOOTH_SWARM_KERNEL(const SwarmWork& work, int first, int last) {
  const BatchView& b = work.energy;
  if (b.quads == 4 && b.normal_quads == kNormalShapes / 4)  // the published budget's 15 coefficients
    run_groups<VectorLanes, 4>(work, first, last);
  else
    run_groups<VectorLanes, 0>(work, first, last);
}

}  // namespace booth::fit
