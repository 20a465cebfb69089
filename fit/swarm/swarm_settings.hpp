// The swarm's own parameters, apart from what it minimises.
#pragma once

namespace booth::fit {

struct SwarmSettings {
  int particles = 2000;
  int iterations = 10;
  float inertia_first = 0.9f, inertia_last = 0.4f;  ///< linear in between (Bansal 2011, strategy "linear decreasing")
  float cognitive = 1.49f, social = 1.49f;          ///< c1, c2
};

}  // namespace booth::fit
