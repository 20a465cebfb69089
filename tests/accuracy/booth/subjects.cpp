// Everything is loaded once.
#include "tests/accuracy/booth/subjects.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "tests/accuracy/report/journal.hpp"

namespace booth::accuracy {

fit::Vertices Subject::surface(const fit::PoseVector& q) const {
  fit::Vertices out;
  model->pose_mesh(body->rest, body->rest_joints, q, out);
  return out;
}

fit::Points3 Subject::joints(const fit::PoseVector& q) const {
  fit::Kinematics kin;
  fit::forward_kinematics(q, bone_vectors(), kin);
  return kin.joint;
}

Subjects::Subjects(const std::filesystem::path& folder) : folder_(daemon::find_models(folder)) {
  const auto prior = std::make_shared<const fit::PosePrior>(daemon::load_pose_prior(folder_ / "pose.npz"));
  models_ = {std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder_ / "men.npz")),
             std::make_shared<const fit::BodyModel>(daemon::load_body_model(folder_ / "women.npz")), prior};
  paper_models_ = {std::make_shared<const fit::BodyModel>(daemon::load_body_model_paper(folder_ / "men.npz")),
                   std::make_shared<const fit::BodyModel>(daemon::load_body_model_paper(folder_ / "women.npz")), prior};
  bodies_ = daemon::load_test_bodies(folder_ / "test_bodies.npz");
}

Subject Subjects::get(int number) const {
  if (number < 1 || number > count()) throw std::out_of_range(fmt::format("there is no set-aside body {}; there are 1 to {}", number, count()));
  const daemon::TestBody& body = bodies_[static_cast<std::size_t>(number - 1)];
  return {number, &body, body.sex == fit::Sex::men ? models_.men : models_.women};
}

std::string Subjects::versions() const { return fmt::format("{}, {}, {}", models_.men->data().version, models_.women->data().version, models_.prior->version); }

std::string Subjects::identity() const {
  std::string out;
  for (const char* name : {"men.npz", "women.npz", "pose.npz", "test_bodies.npz"}) out.append(file_identity(folder_ / name)).append(" ");
  return out;
}

}  // namespace booth::accuracy
