// The sparse matrix keeps its pattern: edges of the mesh, and the diagonal for vertices that have a correspondence.
#include "tests/accuracy/scape/scape_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <stdexcept>

#include "fit/cloud/point_grid.hpp"
#include "tests/accuracy/report/plan.hpp"

namespace booth::accuracy {
namespace {

constexpr int kIterations = 40;
constexpr int kMostPoints = 20000;                        // of the cloud, evenly taken
constexpr float kFirstReach = 0.30f, kLastReach = 0.06f;  // m, how far a correspondence may be: shrinks from the first to the last iteration
constexpr float kNormalGate = 0.5f;                       // cosine
constexpr float kPointWeight = 0.05f;                     // of a correspondence against an edge
constexpr double kShapePrior = 1e-3;                      // m^2, on |beta|^2
constexpr int kShapeFrom = 8;                             // iteration; before it the shape is the mean

class Fitter {
 public:
  Fitter(const ScapeModel& scape, const fit::Cloud& cloud, const fit::PoseVector& start)
      : scape_(scape), faces_(scape.model().data().faces), grid_(kMostPoints, 0.03f), beta_(Eigen::VectorXf::Zero(ScapeModel::kShapes)) {
    take_points(cloud);
    fit::Kinematics kin;
    const fit::ShapeVector mean = fit::ShapeVector::Zero(scape.model().shape_count());
    fit::forward_kinematics(start, scape.model().bone_vectors(mean), kin);
    for (int b = 0; b < fit::kBones; ++b)
      rotations_[static_cast<std::size_t>(b)] = (kin.rotation[static_cast<std::size_t>(b)] * scape.model().rest_rotation(b).transpose()).cast<float>();
    scape.model().posed(mean, start, vertices_);
    scape.pose_deformations(rotations_, pose_);
    deform();
  }

  ScapeFit run() {
    for (int i = 0; i < kIterations; ++i) {
      stop_if_requested();
      const float progress = static_cast<float>(i) / (kIterations - 1);
      solve_vertices(kFirstReach + progress * (kLastReach - kFirstReach));
      solve_rotations();
      scape_.pose_deformations(rotations_, pose_);
      if (i >= kShapeFrom) solve_shape();
      deform();
    }
    return {vertices_, beta_, kIterations};
  }

 private:
  Eigen::Vector3f current_edge(int t, int k) const { return vertices_.col(faces_(k + 1, t)) - vertices_.col(faces_(0, t)); }

  void take_points(const fit::Cloud& cloud) {
    const int count = std::min(cloud.size, kMostPoints);
    for (int s = 0; s < count; ++s) {
      const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count);
      x_.push_back(cloud.x[i]), y_.push_back(cloud.y[i]), z_.push_back(cloud.z[i]);
      nx_.push_back(cloud.nx[i]), ny_.push_back(cloud.ny[i]), nz_.push_back(cloud.nz[i]);
    }
    grid_.rebuild(x_.data(), y_.data(), z_.data(), nx_.data(), ny_.data(), nz_.data(), count);
  }

  /// S of every triangle, and each edge as the model wants it in its part's frame.
  void deform() {
    wanted_.resize(static_cast<std::size_t>(2 * scape_.triangles()));
    for (int t = 0; t < scape_.triangles(); ++t) {
      Eigen::Matrix3f s = scape_.shape_mean(t);
      for (int k = 0; k < beta_.size(); ++k) s += beta_[k] * scape_.shape_direction(t, k);
      for (int e = 0; e < 2; ++e) wanted_[static_cast<std::size_t>(2 * t + e)] = s * (pose_[static_cast<std::size_t>(t)] * scape_.edge(t, e));
    }
  }

  void solve_vertices(float reach) {
    const auto n = vertices_.cols();
    fit::Vertices normals;
    fit::vertex_normals(vertices_, faces_, normals);
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n, 3);
    for (Eigen::Index i = 0; i < n; ++i) {
      const int c = grid_.nearest(vertices_.col(i), reach, normals.col(i), kNormalGate);
      const auto at = static_cast<std::size_t>(std::max(c, 0));
      // The tiny weight on the vertex's own place keeps the problem regular when nothing is near.
      const double weight = c >= 0 ? static_cast<double>(kPointWeight) : 1e-9;
      const Eigen::Vector3f to = c >= 0 ? Eigen::Vector3f(x_[at], y_[at], z_[at]) : Eigen::Vector3f(vertices_.col(i));
      entries.emplace_back(i, i, weight);
      right.row(i) += weight * to.cast<double>().transpose();
    }
    for (int t = 0; t < scape_.triangles(); ++t)
      for (int e = 0; e < 2; ++e) {
        const int a = faces_(0, t), b = faces_(e + 1, t);
        const Eigen::Vector3d d = (rotations_[static_cast<std::size_t>(scape_.part(t))] * wanted_[static_cast<std::size_t>(2 * t + e)]).cast<double>();
        entries.emplace_back(a, a, 1), entries.emplace_back(b, b, 1), entries.emplace_back(std::max(a, b), std::min(a, b), -1);
        right.row(b) += d.transpose(), right.row(a) -= d.transpose();
      }
    Eigen::SparseMatrix<double> matrix(n, n);  // its lower half is what the solver reads
    matrix.setFromTriplets(entries.begin(), entries.end());
    if (!analysed_) solver_.analyzePattern(matrix), analysed_ = true;
    solver_.factorize(matrix);
    if (solver_.info() != Eigen::Success) throw std::runtime_error("SCAPE: the vertices' equations cannot be solved");
    vertices_ = solver_.solve(right).transpose().cast<float>();
  }

  void solve_rotations() {
    std::array<Eigen::Matrix3f, fit::kBones> moment;
    moment.fill(Eigen::Matrix3f::Zero());
    for (int t = 0; t < scape_.triangles(); ++t)
      for (int e = 0; e < 2; ++e)
        moment[static_cast<std::size_t>(scape_.part(t))] += current_edge(t, e) * wanted_[static_cast<std::size_t>(2 * t + e)].transpose();
    for (std::size_t p = 0; p < moment.size(); ++p) {
      if (moment[p].isZero()) continue;  // no triangles
      const Eigen::JacobiSVD<Eigen::Matrix3f> svd(moment[p], Eigen::ComputeFullU | Eigen::ComputeFullV);
      Eigen::Matrix3f u = svd.matrixU();
      if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
      rotations_[p] = u * svd.matrixV().transpose();
    }
  }

  void solve_shape() {
    constexpr int n = ScapeModel::kShapes;
    Eigen::Matrix<double, n, n> normal = kShapePrior * Eigen::Matrix<double, n, n>::Identity();
    Eigen::Matrix<double, n, 1> right = Eigen::Matrix<double, n, 1>::Zero();
    for (int t = 0; t < scape_.triangles(); ++t)
      for (int e = 0; e < 2; ++e) {
        const Eigen::Vector3f posed = pose_[static_cast<std::size_t>(t)] * scape_.edge(t, e);
        const Eigen::Vector3f off = rotations_[static_cast<std::size_t>(scape_.part(t))].transpose() * current_edge(t, e) - scape_.shape_mean(t) * posed;
        Eigen::Matrix<float, 3, n> row;
        for (int k = 0; k < n; ++k) row.col(k) = scape_.shape_direction(t, k) * posed;
        normal += (row.transpose() * row).cast<double>();
        right += (row.transpose() * off).cast<double>();
      }
    beta_ = normal.ldlt().solve(right).cast<float>();
  }

  const ScapeModel& scape_;
  const fit::Faces& faces_;
  fit::PointGrid grid_;
  std::vector<float> x_, y_, z_, nx_, ny_, nz_;
  fit::Vertices vertices_;
  ScapeModel::Rotations rotations_;
  ScapeModel::Deformations pose_;
  Eigen::VectorXf beta_;
  std::vector<Eigen::Vector3f> wanted_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
  bool analysed_ = false;
};

}  // namespace

ScapeFit fit_scape(const ScapeModel& scape, const fit::Cloud& cloud, const fit::PoseVector& start) { return Fitter(scape, cloud, start).run(); }

}  // namespace booth::accuracy
