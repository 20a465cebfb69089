// Task `field`: the nearest point of a cloud by our field, by kd-trees (FLANN, nanoflann) and by brute force: build, query and error in one run.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <flann/flann.hpp>
#include <memory>
#include <random>

#if __has_include(<nanoflann.hpp>)
#include <nanoflann.hpp>
#define BOOTH_HAVE_NANOFLANN
#endif

#include "fit/cloud/cell_field.hpp"
#include "tests/bench/harness/harness.hpp"
#include "tests/bench/support/body_cloud.hpp"

namespace booth::bench {
namespace {

struct Options {
  int points = 60000, queries = 20000, repeats = 15;
  float noise = 0.003f;
};

using Points = std::vector<Eigen::Vector3f>;

/// Uniform in distance up to 0.29 m from points of the cloud, in any direction.
Points make_queries(const fit::Cloud& cloud, int count) {
  std::mt19937 random(3);
  std::uniform_int_distribution<std::size_t> pick(0, static_cast<std::size_t>(cloud.size) - 1);
  std::normal_distribution<float> gauss;
  std::uniform_real_distribution<float> distance(0, 0.29f);
  Points out;
  for (int i = 0; i < count; ++i) {
    const std::size_t k = pick(random);
    const float d = distance(random);
    const Eigen::Vector3f direction(gauss(random), gauss(random), gauss(random));
    out.emplace_back(Eigen::Vector3f(cloud.x[k], cloud.y[k], cloud.z[k]) + d / std::max(direction.norm(), 1e-6f) * direction);
  }
  return out;
}

float brute(const fit::Cloud& cloud, const Eigen::Vector3f& p) {
  float best = 1e30f;
  for (int i = 0; i < cloud.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const float x = cloud.x[k] - p.x(), y = cloud.y[k] - p.y(), z = cloud.z[k] - p.z(), d = x * x + y * y + z * z;
    best = d < best ? d : best;
  }
  return std::sqrt(best);
}

/// What a peer found: build and query seconds and the distances of the queries.
struct Answer {
  std::string name;
  double build = 0, query = 0;
  std::vector<float> distance{};
};

Answer by_cells(const fit::Cloud& cloud, const Points& queries, int threads, int repeats) {
  fit::WorkerPool pool(threads);
  fit::CellField field;
  Answer a{fmt::format("field of cells, {} threads", threads)};
  a.distance.resize(queries.size());
  a.build = median_seconds(repeats, [&] { field.rebuild(cloud, pool); });
  a.query = median_seconds(repeats, [&] {
    Eigen::Vector3f found;
    for (std::size_t i = 0; i < queries.size(); ++i) a.distance[i] = field.nearest(queries[i], found) ? (queries[i] - found).norm() : -1.0f;
  });
  return a;
}

Answer by_flann(const fit::Cloud& cloud, const Points& queries, int repeats) {
  std::vector<float> flat;
  for (int i = 0; i < cloud.size; ++i)
    for (const auto* v : {&cloud.x, &cloud.y, &cloud.z}) flat.push_back((*v)[static_cast<std::size_t>(i)]);
  const flann::Matrix<float> points(flat.data(), static_cast<std::size_t>(cloud.size), 3);
  using Index = flann::Index<flann::L2_Simple<float>>;
  std::unique_ptr<Index> index;
  Answer a{"FLANN kd-tree"};
  a.distance.resize(queries.size());
  a.build = median_seconds(std::min(repeats, 5), [&] {
    index = std::make_unique<Index>(points, flann::KDTreeSingleIndexParams());
    index->buildIndex();
  });
  std::vector<std::size_t> which(queries.size());
  std::vector<float> asked;
  for (const auto& q : queries) asked.insert(asked.end(), {q.x(), q.y(), q.z()});
  const flann::Matrix<float> rows(asked.data(), queries.size(), 3);
  flann::Matrix<std::size_t> indices(which.data(), queries.size(), 1);
  flann::Matrix<float> distances(a.distance.data(), queries.size(), 1);
  a.query = median_seconds(std::min(repeats, 5), [&] { index->knnSearch(rows, indices, distances, 1, flann::SearchParams(flann::FLANN_CHECKS_UNLIMITED)); });
  for (float& d : a.distance) d = std::sqrt(d);
  return a;
}

#ifdef BOOTH_HAVE_NANOFLANN
struct Adaptor {
  const fit::Cloud& cloud;
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(cloud.size); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return axis == 0 ? cloud.x[i] : axis == 1 ? cloud.y[i] : cloud.z[i]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

Answer by_nanoflann(const fit::Cloud& cloud, const Points& queries, int repeats) {
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Adaptor>, Adaptor, 3>;
  const Adaptor adaptor{cloud};
  std::unique_ptr<Tree> tree;
  Answer a{"nanoflann kd-tree"};
  a.distance.resize(queries.size());
  a.build = median_seconds(std::min(repeats, 5), [&] {
    tree = std::make_unique<Tree>(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    tree->buildIndex();
  });
  a.query = median_seconds(std::min(repeats, 5), [&] {
    for (std::size_t i = 0; i < queries.size(); ++i) {
      nanoflann::KNNResultSet<float> result(1);
      std::size_t which = 0;
      result.init(&which, &a.distance[i]);
      tree->findNeighbors(result, queries[i].data(), {});
    }
  });
  for (float& d : a.distance) d = std::sqrt(d);
  return a;
}
#endif

void run(const Options& given, const Common& common, Report& report) {
  Options o = given;
  if (common.short_form) o.points = std::min(o.points, 3000), o.queries = std::min(o.queries, 200), o.repeats = 1;
  const Subject subject = load_subject();
  const fit::Cloud cloud = surface_cloud(subject.model, subject.beta, subject.q, o.points, o.noise, 1);
  const Points queries = make_queries(cloud, o.queries);

  std::vector<Answer> answers{by_cells(cloud, queries, 1, o.repeats), by_cells(cloud, queries, 2, o.repeats), by_flann(cloud, queries, o.repeats)};
#ifdef BOOTH_HAVE_NANOFLANN
  answers.push_back(by_nanoflann(cloud, queries, o.repeats));
#else
  report.note("nanoflann", "skipped: libnanoflann-dev is not installed");
#endif
  // The exact answer, and the time of brute force: on a part of the queries, the rest would take minutes.
  const std::size_t checked = std::min<std::size_t>(queries.size(), 2000);
  std::vector<float> exact(checked);
  Answer all{"brute force"};
  all.query = median_seconds(1,
                             [&] {
                               for (std::size_t i = 0; i < checked; ++i) exact[i] = brute(cloud, queries[i]);
                             }) *
              static_cast<double>(queries.size()) / static_cast<double>(checked);
  all.distance = exact;
  answers.push_back(all);

  const double copy = copy_seconds(static_cast<std::size_t>(cloud.size) * 3 * sizeof(float));
  for (const Answer& a : answers) {
    if (a.build > 0) report.add({a.name + ": build", "ms", 1e3 * a.build, "plain copy of the points", 1e3 * copy});
    report.add(
        {a.name + ": query", "ns", 1e9 * a.query / static_cast<double>(queries.size()), "brute force", 1e9 * all.query / static_cast<double>(queries.size())});
    double sum = 0, near = 0;
    int n = 0, of_near = 0, missing = 0;
    for (std::size_t i = 0; i < checked; ++i) {
      if (exact[i] > 0.28f) continue;
      if (a.distance[i] < 0) {
        ++missing;
        continue;
      }
      const double e = static_cast<double>(std::abs(a.distance[i] - exact[i]));
      sum += e, ++n;
      if (exact[i] < 0.06f) near += e, ++of_near;
    }
    report.add({a.name + ": mean error of the distance within 28 cm", "mm", 1e3 * sum / std::max(n, 1)});
    report.add({a.name + ": mean error of the distance within 6 cm", "mm", 1e3 * near / std::max(of_near, 1)});
    report.add({a.name + ": queries in the band without an answer", "", static_cast<double>(missing)});
  }
}

Run make(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option("--points", o->points, "Points of the cloud")->check(CLI::Range(100, 120000))->capture_default_str();
  app.add_option("--queries", o->queries, "Places that are asked about")->check(CLI::Range(10, 1000000))->capture_default_str();
  app.add_option("--repeats", o->repeats, "Measurements of each figure")->check(CLI::Range(1, 1000))->capture_default_str();
  app.add_option("--noise", o->noise, "Deviation of the points along each axis, m")->check(CLI::Range(0.0f, 0.1f))->capture_default_str();
  return [o](const Common& common, Report& report) { run(*o, common, report); };
}

const Registration registration({"field", "Nearest points: our field against FLANN, nanoflann and brute force: build, query, error", make});

}  // namespace
}  // namespace booth::bench
