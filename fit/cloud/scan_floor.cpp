// The fullest level near the bottom starts a plane, three least-squares rounds finish it, and a map of what is above decides what it is.
#include "fit/cloud/scan_floor.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

namespace booth::fit {
namespace {

constexpr float kSearch = 0.40f;                         // m above the lowest points in which a floor may lie: it may be tilted, and things may lie under it
constexpr float kBin = 0.02f;                            // m, of the histogram of heights
constexpr double kFewest = 100;                          // points
constexpr float kSteepest = 0.18f;                       // slope; 10 degrees
constexpr double kMostBelow = 0.02;                      // share of the points that may lie below
constexpr float kCell = 0.05f;                           // m, of the map
constexpr float kFreeArea = 0.2f;                        // m^2 without anything above
constexpr float kThinnest = 0.015f, kThickest = 0.035f;  // m above the plane that count as floor
constexpr std::array<float, 4> kBands{0.05f, 0.03f, 0.02f, 0.02f};

}  // namespace

ScanFloor find_scan_floor(const Eigen::Matrix3Xf& points) {
  ScanFloor floor;
  std::vector<Eigen::Index> usable;
  std::vector<float> heights;
  for (Eigen::Index i = 0; i < points.cols(); ++i)
    if (points.col(i).cwiseAbs().maxCoeff() < 1000) usable.push_back(i), heights.push_back(points(1, i));
  if (static_cast<double>(heights.size()) < kFewest) return floor;
  const auto lowest = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 1000);
  std::nth_element(heights.begin(), lowest, heights.end());
  const float low = *lowest - kBin;
  std::array<int, static_cast<std::size_t>(kSearch / kBin)> histogram{};
  for (const float h : heights)
    if (const auto bin = static_cast<int>(std::floor((h - low) / kBin)); bin >= 0 && bin < static_cast<int>(histogram.size()))
      ++histogram[static_cast<std::size_t>(bin)];
  const auto fullest = std::max_element(histogram.begin(), histogram.end()) - histogram.begin();

  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Index i : usable) middle += points.col(i).cast<double>() / static_cast<double>(usable.size());
  Eigen::Vector3d plane(static_cast<double>(low + (static_cast<float>(fullest) + 0.5f) * kBin), 0, 0);  // y = plane . (1, x, z)
  const auto above = [&](Eigen::Index i) {
    const double x = static_cast<double>(points(0, i)) - middle.x(), z = static_cast<double>(points(2, i)) - middle.z();
    return static_cast<float>(static_cast<double>(points(1, i)) - plane[0] - plane[1] * x - plane[2] * z);
  };
  double sigma = 0;
  for (const float band : kBands) {
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double count = 0, spread = 0;
    for (const Eigen::Index i : usable) {
      const float h = above(i);
      if (std::abs(h) > band) continue;
      const Eigen::Vector3d row(1, static_cast<double>(points(0, i)) - middle.x(), static_cast<double>(points(2, i)) - middle.z());
      squares += row * row.transpose();
      right += row * static_cast<double>(points(1, i));
      spread += static_cast<double>(h * h);
      ++count;
    }
    if (count < kFewest) return floor;
    squares.diagonal().array() += 1e-6;
    plane = squares.ldlt().solve(right);
    sigma = std::sqrt(spread / count);
  }
  if (!(std::abs(plane[1]) < static_cast<double>(kSteepest) && std::abs(plane[2]) < static_cast<double>(kSteepest))) return floor;

  const float thick = std::clamp(2.5f * static_cast<float>(sigma), kThinnest, kThickest);
  struct Column {
    int on = 0, over = 0;
  };
  std::map<std::pair<int, int>, Column> columns;
  double below = 0;
  for (const Eigen::Index i : usable) {
    const float h = above(i);
    auto& column = columns[{static_cast<int>(std::floor(points(0, i) / kCell)), static_cast<int>(std::floor(points(2, i) / kCell))}];
    if (h < -kThickest) ++below;
    if (std::abs(h) <= thick) ++column.on;
    if (h > 2 * kThickest) ++column.over;
  }
  float free_area = 0;
  for (const auto& [place, column] : columns) free_area += column.on > 0 && column.over == 0 ? kCell * kCell : 0.0f;
  if (free_area < kFreeArea || below > kMostBelow * static_cast<double>(usable.size())) return floor;

  floor.found = true;
  floor.height = static_cast<float>(plane[0]);
  floor.tilt_x = static_cast<float>(plane[1]), floor.tilt_z = static_cast<float>(plane[2]);
  floor.sigma = static_cast<float>(sigma);
  floor.above.assign(static_cast<std::size_t>(points.cols()), 0);
  for (const Eigen::Index i : usable) floor.above[static_cast<std::size_t>(i)] = above(i) > thick;
  return floor;
}

}  // namespace booth::fit
