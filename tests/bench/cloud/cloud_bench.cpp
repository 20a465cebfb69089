// How long a frame spends between the depth images and the fit: cloud, nearest-point field, point grid.
#include <benchmark/benchmark.h>

#include <random>

#include "analytic_scene.hpp"
#include "fit/cloud/cell_field.hpp"
#include "fit/cloud/point_grid.hpp"

namespace booth::fit {
namespace {

struct Booth {
  Booth() : cameras(tests::booth_cameras()), frame(scene(), cameras) {}
  static tests::Scene scene() {
    tests::Scene s;
    s.add_person(0.1f, -0.2f);
    s.noise = 0.003f;
    return s;
  }
  std::vector<Camera> cameras;
  tests::BoothFrame frame;
};

const Booth& booth() {
  static const Booth b;
  return b;
}

/// The person's points, doubled with a little scatter until there are `count`.
Cloud person(int count) {
  CloudBuilder builder({}, booth().cameras);
  Observation seen = builder.make_observation(120000);
  CloudReport report;
  builder.build(booth().frame.inputs, seen, report);
  Cloud out(count);
  std::mt19937 random(1);
  std::normal_distribution<float> gauss(0, 0.003f);
  for (int i = 0; out.size < count; ++i) {
    const auto k = static_cast<std::size_t>(i % seen.cloud.size);
    const float s = i < seen.cloud.size ? 0.0f : 1.0f;
    out.push({seen.cloud.x[k] + s * gauss(random), seen.cloud.y[k] + s * gauss(random), seen.cloud.z[k] + s * gauss(random)},
             {seen.cloud.nx[k], seen.cloud.ny[k], seen.cloud.nz[k]}, 0);
  }
  return out;
}

void build_cloud(benchmark::State& state) {
  CloudBuilder builder({.threads = static_cast<int>(state.range(0))}, booth().cameras);
  Observation out = builder.make_observation(120000);
  CloudReport report;
  for (auto _ : state) builder.build(booth().frame.inputs, out, report);
  state.counters["points"] = report.points;
}
BENCHMARK(build_cloud)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// The same with somebody followed; 24 bones, as the skeleton has.
void build_followed_cloud(benchmark::State& state) {
  CloudBuilder builder({.threads = static_cast<int>(state.range(0))}, booth().cameras);
  Observation out = builder.make_observation(120000);
  CloudReport report;
  std::vector<Followed::Bone> bones;
  for (const auto& c : Booth::scene().capsules) bones.push_back({c.a, c.b, c.radius + 0.08f});
  while (bones.size() < 24) bones.push_back(bones[bones.size() / 2]);
  for (auto _ : state) builder.build(booth().frame.inputs, out, report, {bones, true});
  state.counters["points"] = report.points;
}
BENCHMARK(build_followed_cloud)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

void rebuild_field(benchmark::State& state) {
  const Cloud cloud = person(60000);
  CellField field;
  WorkerPool pool(static_cast<int>(state.range(0)));
  for (auto _ : state) field.rebuild(cloud, pool);
}
BENCHMARK(rebuild_field)->Arg(1)->Arg(2)->ArgName("threads")->Unit(benchmark::kMillisecond)->UseRealTime();

std::vector<Eigen::Vector3f> queries(const Cloud& cloud, float spread) {
  std::mt19937 random(2);
  std::normal_distribution<float> gauss(0, spread);
  std::uniform_int_distribution<std::size_t> pick(0, static_cast<std::size_t>(cloud.size) - 1);
  std::vector<Eigen::Vector3f> out;
  for (int i = 0; i < 4096; ++i) {
    const std::size_t k = pick(random);
    out.emplace_back(cloud.x[k] + gauss(random), cloud.y[k] + gauss(random), cloud.z[k] + gauss(random));
  }
  return out;
}

void query_field(benchmark::State& state) {
  const Cloud cloud = person(60000);
  CellField field;
  WorkerPool pool(2);
  field.rebuild(cloud, pool);
  const auto points = queries(cloud, 0.05f);
  std::size_t i = 0;
  Eigen::Vector3f found;
  for (auto _ : state) benchmark::DoNotOptimize(field.nearest(points[i++ % points.size()], found));
}
BENCHMARK(query_field);

void rebuild_grid(benchmark::State& state) {
  const Cloud cloud = person(60000);
  const int n = static_cast<int>(state.range(0)), stride = cloud.size / n;
  Cloud vertices(n);
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i * stride);
    vertices.push({cloud.x[k], cloud.y[k], cloud.z[k]}, {cloud.nx[k], cloud.ny[k], cloud.nz[k]}, 0);
  }
  PointGrid grid(n);
  for (auto _ : state) grid.rebuild(vertices.x.data(), vertices.y.data(), vertices.z.data(), vertices.nx.data(), vertices.ny.data(), vertices.nz.data(), n);
}
BENCHMARK(rebuild_grid)->Arg(1000)->Arg(6000)->Unit(benchmark::kMicrosecond);

/// Queries some way off the surface, the distances of a tracked and of a lost body, with the gate on normals.
void query_grid(benchmark::State& state) {
  const Cloud cloud = person(60000);
  const int n = static_cast<int>(state.range(0)), stride = cloud.size / n;
  Cloud vertices(n);
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i * stride);
    vertices.push({cloud.x[k], cloud.y[k], cloud.z[k]}, {cloud.nx[k], cloud.ny[k], cloud.nz[k]}, 0);
  }
  PointGrid grid(n);
  grid.rebuild(vertices.x.data(), vertices.y.data(), vertices.z.data(), vertices.nx.data(), vertices.ny.data(), vertices.nz.data(), n);
  const auto points = queries(cloud, static_cast<float>(state.range(1)) * 0.001f);
  std::size_t i = 0;
  for (auto _ : state) {
    const Eigen::Vector3f& p = points[i++ % points.size()];
    const Eigen::Vector3f normal = Eigen::Vector3f(p.x() - 0.1f, 0, p.z() + 0.2f).normalized();  // away from the figure's middle
    benchmark::DoNotOptimize(grid.nearest(p, 0.15f, normal, 0.3f));
  }
}
BENCHMARK(query_grid)->ArgsProduct({{1000, 6000}, {10, 50}})->ArgNames({"points", "off_mm"});

}  // namespace
}  // namespace booth::fit

BENCHMARK_MAIN();
