// Farthest-point sampling on the mean body.
#include "fit/body/sampling.hpp"

#include <algorithm>
#include <limits>

namespace booth::fit {

std::vector<int> spread_vertices(const BodyModel& model, int count) {
  const Vertices& v = model.data().mean;
  const int n = model.vertex_count();
  std::vector<float> distance(static_cast<std::size_t>(n), std::numeric_limits<float>::max());
  std::vector<int> order;
  order.reserve(static_cast<std::size_t>(std::min(count, n)));
  Eigen::Index next = 0;
  v.row(1).maxCoeff(&next);  // the top of the head: a place that every model has
  while (static_cast<int>(order.size()) < std::min(count, n)) {
    order.push_back(static_cast<int>(next));
    const Eigen::Vector3f p = v.col(next);
    float farthest = -1;
    for (int i = 0; i < n; ++i) {
      float& d = distance[static_cast<std::size_t>(i)];
      d = std::min(d, (v.col(i) - p).squaredNorm());
      if (d > farthest) farthest = d, next = i;
    }
  }
  return order;
}

std::vector<float> represented_area(const BodyModel& model, const std::vector<int>& vertices) {
  const Vertices& v = model.data().mean;
  std::vector<float> area(vertices.size(), 0);
  for (int i = 0; i < model.vertex_count(); ++i) {
    std::size_t best = 0;
    float best_distance = std::numeric_limits<float>::max();
    for (std::size_t s = 0; s < vertices.size(); ++s) {
      const float d = (v.col(vertices[s]) - v.col(i)).squaredNorm();
      if (d < best_distance) best_distance = d, best = s;
    }
    area[best] += model.vertex_area()[i];
  }
  return area;
}

}  // namespace booth::fit
