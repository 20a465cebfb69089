// Compressed rows over the mesh's edges, and conjugate gradients on them.
#include "fit/detail/surface_system.hpp"

#include <algorithm>
#include <stdexcept>

namespace booth::fit {

SurfaceSystem::SurfaceSystem(const Faces& faces, int vertex_count) : faces_(faces) {
  if (faces.cols() == 0 || faces.minCoeff() < 0 || faces.maxCoeff() >= vertex_count)
    throw std::invalid_argument("surface: a face names a vertex that does not exist");
  std::vector<std::vector<int>> around(static_cast<std::size_t>(vertex_count));
  for (Eigen::Index f = 0; f < faces_.cols(); ++f)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        if (i != j) around[static_cast<std::size_t>(faces_(i, f))].push_back(faces_(j, f));
  first_.push_back(0);
  for (auto& row : around) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    neighbour_.insert(neighbour_.end(), row.begin(), row.end());
    first_.push_back(static_cast<int>(neighbour_.size()));
  }
  const auto place = [&](int from, int to) {
    const auto begin = neighbour_.begin() + first_[static_cast<std::size_t>(from)], end = neighbour_.begin() + first_[static_cast<std::size_t>(from) + 1];
    return static_cast<int>(std::lower_bound(begin, end, to) - neighbour_.begin());
  };
  for (Eigen::Index f = 0; f < faces_.cols(); ++f) {
    const auto t = faces_.col(f);
    place_.push_back({place(t[0], t[1]), place(t[0], t[2]), place(t[1], t[0]), place(t[1], t[2]), place(t[2], t[0]), place(t[2], t[1])});
  }
  coupling_.assign(neighbour_.size(), 0);
  for (auto* v : {&diagonal_, &right_, &residual_, &step_, &product_, &fresh_}) v->setZero(vertex_count);
}

void SurfaceSystem::reset() { scale(0); }

void SurfaceSystem::scale(double factor) {
  for (double& c : coupling_) c *= factor;
  diagonal_ *= factor;
  right_ *= factor;
}

void SurfaceSystem::add(int face, const std::array<float, 3>& a, float value, float weight) {
  const auto t = faces_.col(face);
  const auto& place = place_[static_cast<std::size_t>(face)];
  const double w = static_cast<double>(weight), v = static_cast<double>(value);
  const std::array<double, 3> c{static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
  for (int i = 0; i < 3; ++i) {
    diagonal_[t[i]] += w * c[static_cast<std::size_t>(i)] * c[static_cast<std::size_t>(i)];
    right_[t[i]] += w * c[static_cast<std::size_t>(i)] * v;
  }
  const double c01 = w * c[0] * c[1], c02 = w * c[0] * c[2], c12 = w * c[1] * c[2];
  const double pair[6] = {c01, c02, c01, c12, c02, c12};
  for (std::size_t k = 0; k < 6; ++k) coupling_[static_cast<std::size_t>(place[k])] += pair[k];
}

void SurfaceSystem::multiply(const Regularisation& r, const Eigen::VectorXd& in, Eigen::VectorXd& out) const {
  for (int v = 0; v < size(); ++v) {
    const auto begin = static_cast<std::size_t>(first_[static_cast<std::size_t>(v)]), end = static_cast<std::size_t>(first_[static_cast<std::size_t>(v) + 1]);
    double sum = (diagonal_[v] + r.size + r.step * static_cast<double>(end - begin)) * in[v];
    for (std::size_t k = begin; k < end; ++k) sum += (coupling_[k] - r.step) * in[neighbour_[k]];
    out[v] = sum;
  }
}

void SurfaceSystem::solve(const Regularisation& r, int iterations, Eigen::VectorXd& d) {
  const auto preconditioned = [&](Eigen::VectorXd& out) {
    for (int v = 0; v < size(); ++v) {
      const int degree = first_[static_cast<std::size_t>(v) + 1] - first_[static_cast<std::size_t>(v)];
      out[v] = residual_[v] / (diagonal_[v] + r.size + r.step * degree);
    }
  };
  constexpr double kEnough = 1e-10;  // of the first residual's square
  multiply(r, d, product_);
  residual_ = right_ - product_;
  preconditioned(fresh_);
  step_ = fresh_;
  double gain = residual_.dot(fresh_);
  const double enough = kEnough * gain;
  for (int i = 0; i < iterations && gain > enough && gain > 0; ++i) {
    multiply(r, step_, product_);
    const double length = gain / step_.dot(product_);
    d += length * step_;
    residual_ -= length * product_;
    preconditioned(fresh_);
    const double next = residual_.dot(fresh_);
    step_ = fresh_ + (next / gain) * step_;
    gain = next;
  }
}

std::size_t SurfaceSystem::memory_bytes() const {
  return sizeof(*this) + static_cast<std::size_t>(faces_.size()) * sizeof(int) + place_.size() * sizeof(place_[0]) +
         coupling_.size() * (sizeof(double) + sizeof(int)) + static_cast<std::size_t>(size()) * (6 * sizeof(double) + sizeof(int));
}

}  // namespace booth::fit
