// Angles in degrees, signs as in docs/reference/skeleton.md; right limbs are the mirror image of left ones.
#include "tests/accuracy/booth/poses.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "daemon/io/mocap_folder.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/pose_words.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::accuracy {
namespace {

using fit::PoseVector;
constexpr double kDegree = std::numbers::pi / 180;

using drivers::with;
using drivers::with_left_arm;
using drivers::with_right_arm;
using Arm = drivers::ArmAngles;
constexpr Arm kHanging{-37, -15, 85, 25};

PoseVector stand() {
  const PoseVector q =
      with(PoseVector::Zero(), {{"lfemur_rz", -17}, {"rfemur_rz", 17}, {"lfemur_rx", -3}, {"rfemur_rx", -3}, {"ltibia_rx", 6}, {"rtibia_rx", 6}});
  return with_right_arm(with_left_arm(q, kHanging), kHanging);
}

/// Moves every limb angle by at most `degrees`, evenly.
PoseVector shaken(PoseVector q, double degrees, Random& random) {
  for (int k = fit::kRootDofs; k < fit::kDofs; ++k) q[k] += (2 * random.uniform() - 1) * degrees * kDegree;
  // Knees and elbows do not bend backwards.
  for (const char* hinge : {"ltibia_rx", "rtibia_rx", "lradius_rx", "rradius_rx"}) q[fit::dof_index(hinge)] = std::max(0.0, q[fit::dof_index(hinge)]);
  return q;
}

double between(double low, double high, Random& random) { return low + (high - low) * random.uniform(); }

PoseVector standing(const Subject& subject, const Eigen::MatrixXf& recorded, Random& random) {
  if (recorded.cols() > 0) {
    const auto column = static_cast<Eigen::Index>(random.uniform() * static_cast<double>(recorded.cols()));
    return recorded.col(std::min(column, recorded.cols() - 1)).cast<double>();
  }
  static constexpr std::array<const char*, 9> kMotions{"walk", "turn", "wave", "kick", "squat", "roll-hands", "jump", "a-pose", "left-arm"};
  const auto which = std::min<std::size_t>(kMotions.size() - 1, static_cast<std::size_t>(random.uniform() * kMotions.size()));
  const auto contact = drivers::contact_of(*subject.model, subject.body->rest, subject.body->rest_joints);
  const drivers::Motion motion = drivers::motion_by_name(kMotions[which], 0, contact);
  return shaken(motion.at(random.uniform() * motion.seconds()), 6, random);
}

PoseVector lying(Random& random) {
  PoseVector q = stand();
  const double side = random.uniform();
  if (side < 0.4)
    q = with(q, {{"root_rx", -90}});  // on the back
  else if (side < 0.7)
    q = with(q, {{"root_rx", 90}});  // on the front
  else
    q = with(q, {{"root_rz", side < 0.85 ? 90.0 : -90.0}});
  const bool front = side >= 0.4 && side < 0.7;
  for (const bool left : {true, false}) {
    const Arm arm{between(-40, 0, random), between(-20, 0, random), between(10, 85, random), between(5, 60, random)};
    q = left ? with_left_arm(q, arm) : with_right_arm(q, arm);
    const double hip = front ? 0 : between(0, 45, random), knee = front ? between(5, 30, random) : between(hip, 1.6 * hip + 5, random);
    q = left ? with(q, {{"lfemur_rx", -hip}, {"ltibia_rx", knee}}) : with(q, {{"rfemur_rx", -hip}, {"rtibia_rx", knee}});
  }
  return shaken(q, 4, random);
}

PoseVector crouching(Random& random) {
  const double pelvis = between(12, 30, random), hip = between(75, 110, random), knee = between(hip, 125, random);
  const double ankle = std::max(-35.0, hip - knee - pelvis);
  PoseVector q = with(stand(), {{"root_rx", pelvis},
                                {"lfemur_rx", -hip},
                                {"rfemur_rx", -hip},
                                {"ltibia_rx", knee},
                                {"rtibia_rx", knee},
                                {"lfoot_rx", ankle},
                                {"rfoot_rx", ankle},
                                {"upperback_rx", 12},
                                {"neck_rx", -15},
                                {"lfemur_ry", between(0, 14, random)},
                                {"rfemur_ry", -8}});
  const double forward = random.uniform();  // from hanging beside the knees to stretched out
  const Arm arm{-37 + 77 * forward, -15 + 15 * forward, 86, 26};
  q = with_right_arm(with_left_arm(q, arm), arm);
  return shaken(q, 5, random);
}

PoseVector arms_crossed(Random& random) {
  // The forearms lie before the chest, one above the other.
  const double height = between(-4, 4, random);
  PoseVector q = with_left_arm(stand(), {-7 + height, -44, 74, 104});
  q = with_right_arm(q, {-16 + height, -40, 74, 100});
  return shaken(q, 4, random);
}

PoseVector legs_touching(Random& random) {
  const double closed = between(21, 24, random);
  PoseVector q = with(stand(), {{"lfemur_rz", -closed}, {"rfemur_rz", closed}, {"lfemur_rx", -2}, {"rfemur_rx", -2}, {"ltibia_rx", 4}, {"rtibia_rx", 4}});
  q = shaken(q, 5, random);
  return with(q, {{"lfemur_rz", -closed}, {"rfemur_rz", closed}});
}

}  // namespace

PoseVector study_pose(const Subject& subject, int number) {
  if (number == 1) return subject.model->rest_pose();
  if (number == 2) return with(with_right_arm(with_left_arm(stand(), {27, 42, 5, 95}), {33, 45, 8, 55}), {{"head_ry", 10}});
  PoseVector q = with_left_arm(with_right_arm(stand(), {-50, -14, 86, 38}), {5, -10, 80, 35});
  return with(q, {{"root_rx", -6},
                  {"rfemur_rx", -65},
                  {"rtibia_rx", 15},
                  {"rfoot_rx", 12},
                  {"lfemur_rx", 2},
                  {"ltibia_rx", 12},
                  {"lfoot_rx", -6},
                  {"upperback_rx", 10},
                  {"upperback_ry", 24},
                  {"upperback_rz", 4},
                  {"root_rz", 3},
                  {"head_ry", -15}});
}

std::string_view name_of(PoseKind kind) {
  switch (kind) {
    case PoseKind::standing:
      return "standing";
    case PoseKind::lying:
      return "lying";
    case PoseKind::crouching:
      return "crouching";
    case PoseKind::arms_crossed:
      return "arms crossed";
    case PoseKind::legs_touching:
      return "legs touching";
  }
  return "";
}

PoseVector random_pose(const Subject& subject, PoseKind kind, const Eigen::MatrixXf& recorded, Random& random) {
  switch (kind) {
    case PoseKind::lying:
      return lying(random);
    case PoseKind::crouching:
      return crouching(random);
    case PoseKind::arms_crossed:
      return arms_crossed(random);
    case PoseKind::legs_touching:
      return legs_touching(random);
    case PoseKind::standing:
      break;
  }
  return standing(subject, recorded, random);
}

PoseVector on_stage(const Subject& subject, PoseVector q, double heading, double x, double z) {
  q[0] = q[1] = q[2] = 0;
  q[4] = heading;
  const fit::Vertices v = subject.surface(q);
  const Eigen::Vector3d low = v.rowwise().minCoeff().cast<double>(), high = v.rowwise().maxCoeff().cast<double>();
  q[0] = x - (low.x() + high.x()) / 2;
  q[1] = -low.y();
  q[2] = z - (low.z() + high.z()) / 2;
  return q;
}

PoseVector anywhere(const Subject& subject, const PoseVector& q, double radius, Random& random) {
  const double heading = (2 * random.uniform() - 1) * std::numbers::pi, r = radius * std::sqrt(random.uniform()),
               turn = 2 * std::numbers::pi * random.uniform();
  return on_stage(subject, q, heading, r * std::cos(turn), r * std::sin(turn));
}

Eigen::MatrixXf held_out_frames(const std::filesystem::path& data, const Subjects& subjects, int stride) {
  const daemon::MotionFolder folder = daemon::load_motion_folder(data, subjects.folder() / "held_out_motions.csv");
  std::vector<int> columns;
  for (const auto& clip : folder.clips)
    if (clip.use == daemon::MotionUse::held_out)
      for (int k = 0; k < clip.frames; k += stride) columns.push_back(clip.start + k);
  return folder.q(Eigen::all, columns);
}

}  // namespace booth::accuracy
