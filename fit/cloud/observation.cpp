// Fixed-capacity storage of an observation.
#include "fit/cloud/observation.hpp"

namespace booth::fit {

Cloud::Cloud(int capacity) {
  for (auto* a : {&x, &y, &z, &nx, &ny, &nz}) a->resize(static_cast<std::size_t>(capacity));
  camera.resize(static_cast<std::size_t>(capacity));
}

bool Cloud::push(const Eigen::Vector3f& p, const Eigen::Vector3f& n, std::uint8_t c) {
  if (size == capacity()) return false;
  const auto i = static_cast<std::size_t>(size++);
  x[i] = p.x(), y[i] = p.y(), z[i] = p.z();
  nx[i] = n.x(), ny[i] = n.y(), nz[i] = n.z();
  camera[i] = c;
  return true;
}

}  // namespace booth::fit
