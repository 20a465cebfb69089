// Farthest-point sampling on the mean body.
#include "fit/body/sampling.hpp"

#include <algorithm>
#include <limits>

namespace booth::fit {

std::vector<int> spread_vertices(const BodyModel& model, int count) {
  using Row = Eigen::Array<float, 1, Eigen::Dynamic>;
  const Vertices& v = model.data().mean;
  // Coordinate by coordinate, so that the compiler's vectors hold vertices: a third of what boothd computes at its start is this, once for each poser.
  const Row x = v.row(0), y = v.row(1), z = v.row(2);
  Row distance = Row::Constant(v.cols(), std::numeric_limits<float>::max());
  const int wanted = std::min(count, model.vertex_count());
  std::vector<int> order;
  order.reserve(static_cast<std::size_t>(wanted));
  Eigen::Index next = 0;
  y.maxCoeff(&next);  // the top of the head: a place that every model has
  while (static_cast<int>(order.size()) < wanted) {
    order.push_back(static_cast<int>(next));
    distance = distance.min((x - x[next]).square() + ((y - y[next]).square() + (z - z[next]).square()));
    next = std::find(distance.begin(), distance.end(), distance.maxCoeff()) - distance.begin();  // the first of equals
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
