// Each edge is looked at from both of its ends; edges of two facets count twice at both, which changes no mean.
#include "fit/body/facet_fall.hpp"

#include <utility>

namespace booth::fit {

std::vector<float> facet_fall(const BodyModelData& data) {
  const auto count = static_cast<std::size_t>(data.mean.cols());
  Vertices normals;
  vertex_normals(data.mean, data.faces, normals);
  std::vector<float> sum(count), edges(count);
  for (Eigen::Index f = 0; f < data.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int a = data.faces(k, f), b = data.faces((k + 1) % 3, f);
      for (const auto& [at, to] : {std::pair{a, b}, {b, a}}) {
        const Eigen::Vector3f edge = data.mean.col(to) - data.mean.col(at), normal = normals.col(at);
        const float below = -normal.dot(edge), across = (edge + below * normal).norm();
        if (across < 1e-4f) continue;  // a spike has no tangent plane
        sum[static_cast<std::size_t>(at)] += below / across;
        edges[static_cast<std::size_t>(at)] += 1;
      }
    }
  }
  for (std::size_t v = 0; v < count; ++v)
    if (edges[v] > 0) sum[v] /= edges[v];
  return sum;
}

}  // namespace booth::fit
