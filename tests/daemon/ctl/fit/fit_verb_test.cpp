// `boothctl fit` from a file to files, with the models that are shipped.
#include "daemon/ctl/fit_verb.hpp"

#include <gmock/gmock.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "daemon/ctl/fit_input.hpp"
#include "daemon/io/mesh_file.hpp"
#include "daemon/io/model_file.hpp"
#include "fit/body/surface_distance.hpp"
#include "tests/daemon/io/scratch_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using tests::message_of;
using tests::ScratchFolder;

void boothctl(std::vector<std::string> arguments) {
  CLI::App app;
  add_fit_verb(app);
  std::reverse(arguments.begin(), arguments.end());
  app.parse(arguments);
}

/// A man of the shape space who walks through the stage, one metre off its middle.
struct Person {
  fit::BodyModel model = load_body_model(find_models() / "men.npz");
  fit::ShapeVector beta;
  fit::PoseVector q = model.rest_pose();
  fit::Vertices vertices;
  fit::Points3 joints;

  Person() {
    beta.resize(6);
    beta << 1.1, -0.8, 0.5, 0.9, -0.4, 0.3;
    q.head<3>() << 0.6, 0.95, 0.8;
    q[fit::dof_index("root_ry")] = 0.5;
    q[fit::dof_index("lfemur_rx")] = -0.45;
    q[fit::dof_index("rtibia_rx")] = 0.5;
    q[fit::dof_index("lradius_rx")] = 0.7;
    model.posed(beta, q, vertices);
    fit::Kinematics k;
    fit::forward_kinematics(q, model.bone_vectors(beta), k);
    joints = k.joint;
  }
  std::filesystem::path mesh(const ScratchFolder& folder) const {
    write_ply(folder / "scan.ply", {vertices, nullptr, &model.data().faces});
    return folder / "scan.ply";
  }
};

nlohmann::json fit_of(const std::filesystem::path& out) { return nlohmann::json::parse(ScratchFolder::get(out / "fit.json")); }

TEST(FitVerb, RecoversAPersonFromAScan) {
  ScratchFolder folder;
  const Person person;
  boothctl({"fit", person.mesh(folder).string(), "--out", (folder / "out").string()});
  const auto json = fit_of(folder / "out");
  EXPECT_EQ(json["sex"], "men");
  EXPECT_EQ(json["coverage"], "full");
  EXPECT_LT(json["cloud_to_model"]["mean"].get<double>(), 0.004);
  const auto truth = file_from_cmu(person.joints, UpAxis::z);
  double sum = 0;
  for (int j = 0; j < fit::kJoints; ++j) {
    const auto p = json["joints"][std::string(fit::bones()[static_cast<std::size_t>(j)].end_joint)].get<std::vector<double>>();
    sum += (Eigen::Vector3d(p[0], p[1], p[2]) - truth.col(j)).norm();
  }
  EXPECT_LT(sum / fit::kJoints, 0.015) << "mean joint error, in the frame of the input";

  // The mesh that was written lies on the one that was read, in the input's frame.
  const CloudFile body = read_cloud_file(folder / "out" / "body.ply");
  ASSERT_EQ(body.points.cols(), person.vertices.cols());
  fit::SurfaceDistance surface(person.model.data().faces, person.model.vertex_count());
  surface.set(person.vertices);
  double distance = 0;
  for (Eigen::Index i = 0; i < body.points.cols(); ++i) distance += surface.distance(body.points.col(i));
  EXPECT_LT(distance / static_cast<double>(body.points.cols()), 0.005);
  EXPECT_EQ(ScratchFolder::get(folder / "out" / "body.glb").substr(0, 4), "glTF");
}

TEST(FitVerb, GivesTheSameNumbersForAnyNumberOfThreads) {
  ScratchFolder folder;
  const Person person;
  const std::string mesh = person.mesh(folder).string();
  std::vector<nlohmann::json> results;
  for (const char* threads : {"1", "3"}) {
    boothctl({"fit", mesh, "--model", "men", "--threads", threads, "--out", (folder / threads).string()});
    results.push_back(fit_of(folder / threads));
    results.back().erase("threads");
    results.back().erase("total_ms");
  }
  EXPECT_EQ(results[0], results[1]);
}

TEST(FitVerb, TakesMillimetresAndYUpWhenToldSo) {
  ScratchFolder folder;
  const Person person;
  const Eigen::Matrix3Xf millimetres = person.vertices * 1000;
  write_ply(folder / "mm.ply", {millimetres, nullptr, &person.model.data().faces}, UpAxis::y);
  EXPECT_THAT(message_of([&] { boothctl({"fit", (folder / "mm.ply").string(), "--up", "y", "--out", (folder / "out").string()}); }), HasSubstr("--units mm"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  boothctl({"fit", (folder / "mm.ply").string(), "--units", "auto", "--up", "y", "--model", "men", "--out", (folder / "out").string()});
  const auto head = fit_of(folder / "out")["joints"]["head_top"].get<std::vector<double>>();
  const Eigen::Vector3d truth = person.joints.col(fit::joint_index("head_top"));
  EXPECT_LT((Eigen::Vector3d(head[0], head[1], head[2]) - truth).norm(), 0.03) << "metres, y up";
}

TEST(FitVerb, DetailLiesOnTheScanWhereTheBodyDoesNot) {
  ScratchFolder folder;
  Person person;
  // A hat and a coat: what no shape holds.
  const float shoulders = static_cast<float>(person.joints(1, fit::joint_index("chest_top"))),
              head = static_cast<float>(person.joints(1, fit::joint_index("head_base")));
  fit::Vertices normals;
  fit::vertex_normals(person.vertices, person.model.data().faces, normals);
  for (Eigen::Index v = 0; v < person.vertices.cols(); ++v) {
    const float y = person.vertices(1, v);
    const float coat = y > 0.5f && y < shoulders ? 0.012f * (1 + std::sin(25 * y)) : 0.0f;
    person.vertices.col(v) += (y > head + 0.08f ? 0.03f : coat) * normals.col(v);
  }
  const std::string mesh = person.mesh(folder).string();
  boothctl({"fit", mesh, "--model", "men", "--detail", "--clothed", "--out", (folder / "out").string()});
  const auto json = fit_of(folder / "out");
  EXPECT_EQ(json["clothed"], true);
  EXPECT_LT(json["cloud_to_model_detail"]["mean"].get<double>(), 0.003);
  EXPECT_LT(json["cloud_to_model_detail"]["mean"].get<double>(), 0.5 * json["cloud_to_model"]["mean"].get<double>());
  EXPECT_GT(json["detail"]["seen_fraction"].get<double>(), 0.8);
  EXPECT_GT(json["detail"]["largest_offset"].get<double>(), 0.015);
  for (const auto& [name, m] : json["measurements"].items()) EXPECT_GT(m["sd"].get<double>(), 0) << name;

  // The mesh that was written is the detailed one.
  const CloudFile body = read_cloud_file(folder / "out" / "body.ply");
  fit::SurfaceDistance surface(person.model.data().faces, person.model.vertex_count());
  surface.set(body.points);
  double distance = 0;
  for (Eigen::Index i = 0; i < person.vertices.cols(); ++i) distance += surface.distance(person.vertices.col(i));
  EXPECT_LT(distance / static_cast<double>(person.vertices.cols()), 0.003);
  EXPECT_EQ(ScratchFolder::get(folder / "out" / "body.glb").substr(0, 4), "glTF");
}

TEST(FitVerb, TakesOutTheFloorThatWasScannedToo) {
  ScratchFolder folder;
  Person person;
  const float lowest = person.vertices.row(1).minCoeff();
  Eigen::Matrix3Xf points, normals;
  sample_surface(person.vertices, person.model.data().faces, 20000, points, normals);
  constexpr Eigen::Index kFloor = 8000;
  points.conservativeResize(3, 20000 + kFloor);
  for (Eigen::Index i = 0; i < kFloor; ++i) {
    const double u = std::fmod((i + 1) * 0.7548776662466927, 1.0) - 0.5, v = std::fmod((i + 1) * 0.5698402909980532, 1.0) - 0.5;
    points.col(20000 + i) << 0.6f + 2.4f * static_cast<float>(u), lowest + 0.02f * static_cast<float>(u), 0.8f + 2.4f * static_cast<float>(v);
  }
  write_ply(folder / "floor.ply", {points});
  boothctl({"fit", (folder / "floor.ply").string(), "--model", "men", "--out", (folder / "out").string()});
  const auto json = fit_of(folder / "out");
  EXPECT_NEAR(json["input"]["floor"].get<double>(), static_cast<double>(kFloor), 600);
  EXPECT_LT(json["cloud_to_model"]["mean"].get<double>(), 0.006);
  const auto head = json["joints"]["head_top"].get<std::vector<double>>();
  const auto truth = file_from_cmu(person.joints, UpAxis::z);
  EXPECT_LT((Eigen::Vector3d(head[0], head[1], head[2]) - truth.col(fit::joint_index("head_top"))).norm(), 0.03);
}

TEST(FitVerb, SaysThatTheBodyLiesWhenTheAxesAreWrong) {
  ScratchFolder folder;
  const Person person;
  write_ply(folder / "y.ply", {person.vertices, nullptr, &person.model.data().faces}, UpAxis::y);
  const std::string failure = message_of([&] { boothctl({"fit", (folder / "y.ply").string(), "--model", "men", "--out", (folder / "out").string()}); });
  if (failure.empty())
    EXPECT_THAT(fit_of(folder / "out")["warnings"].dump(), HasSubstr("--up y"));
  else
    EXPECT_THAT(failure, HasSubstr("--up"));
}

TEST(FitVerb, WarnsThatOneSideIsOnlyHalfOfABody) {
  ScratchFolder folder;
  const Person person;
  // What a camera in front of the person sees, without what hides itself: enough for a body's front.
  Eigen::Matrix3Xf points, normals;
  sample_surface(person.vertices, person.model.data().faces, 30000, points, normals);
  const Eigen::Vector3f camera(person.q[0], 1.2f, person.q[2] + 2.5f);
  Eigen::Index n = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i)
    if (normals.col(i).dot((camera - points.col(i)).normalized()) > 0.2f) points.col(n++) = points.col(i);
  points.conservativeResize(3, n);
  write_ply(folder / "front.ply", {points});
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  std::string text, printed;
  const std::string failure = message_of([&] {
    boothctl({"fit", (folder / "front.ply").string(), "--model", "men", "--json", "--out", (folder / "out").string()});
  });
  text = ::testing::internal::GetCapturedStderr();
  printed = ::testing::internal::GetCapturedStdout();
  EXPECT_EQ(failure, "");
  EXPECT_THAT(text, HasSubstr("coverage: partial"));
  EXPECT_EQ(fit_of(folder / "out")["coverage"], "partial");
  EXPECT_EQ(printed, ScratchFolder::get(folder / "out" / "fit.json")) << "--json prints the file and nothing else";
}

TEST(FitVerb, RefusesWhatIsNoPersonAndWhatItCannotDo) {
  ScratchFolder folder;
  const std::string out = (folder / "out").string();
  std::string cube;
  for (int i = 0; i < 3000; ++i) {
    std::array<double, 3> p{std::fmod(i * 0.7548776662, 1), std::fmod(i * 0.5698402909, 1), std::fmod(i * 0.3819660113, 1)};
    p[static_cast<std::size_t>(i % 3)] = i % 2;
    cube += std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + "\n";
  }
  const std::string path = folder.put("cube.xyz", cube).string();
  EXPECT_THAT(message_of([&] { boothctl({"fit", path, "--out", out}); }), HasSubstr("no person in the input"));
  EXPECT_THAT(message_of([&] { boothctl({"fit", path, "--clothed", "--preset", "paper", "--out", out}); }), HasSubstr("--clothed needs preset booth"));
  EXPECT_THAT(message_of([&] { boothctl({"fit", path, "--models", folder.path().string(), "--out", out}); }), HasSubstr(folder.path().string()));
  EXPECT_THROW(boothctl({"fit"}), CLI::ParseError);
  EXPECT_THROW(boothctl({"fit", path, "--model", "child"}), CLI::ParseError);
  EXPECT_THROW(boothctl({"fit", path, "--threads", "0"}), CLI::ParseError);
  EXPECT_FALSE(std::filesystem::exists(out)) << "nothing is written when nothing was found";
}

}  // namespace
}  // namespace booth::daemon
