// Three formats, one result; every count and name in a file is checked before it is used.
#include "daemon/io/motion_file.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>

#include "daemon/io/cmu_fold.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/io/npz.hpp"
#include "daemon/io/text_scanner.hpp"

namespace booth::daemon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr std::uint64_t kMostBytes = 512u << 20;
constexpr std::size_t kMostFrames = 10'000'000;
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMetresPerUnit = 0.0254 / 0.45;  // ASF files state lengths in inches times 0.45

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) { throw std::runtime_error(path.string() + ": " + what); }

Matrix3d zyx(double rx, double ry, double rz) {
  return (Eigen::AngleAxisd(rz, Vector3d::UnitZ()) * Eigen::AngleAxisd(ry, Vector3d::UnitY()) * Eigen::AngleAxisd(rx, Vector3d::UnitX())).matrix();
}

double finite_number(const std::filesystem::path& path, const TextScanner& in, std::string_view word) {
  double value = 0;
  if (!parse_number(word, value) || !std::isfinite(value)) fail(path, in.where() + ": '" + std::string(word.substr(0, 40)) + "' is no finite number");
  return value;
}

std::vector<fit::PoseVector> read_npy_motion(const std::filesystem::path& path) {
  const NpzArray a = read_npy(path);
  if (a.type == NpzType::text || a.shape.size() != 2 || a.shape[1] != fit::kDofs || a.shape[0] == 0)
    fail(path, "must be an array of numbers of shape N x 36 with at least one row");
  std::vector<fit::PoseVector> frames(a.shape[0]);
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double value = a.number(i);
    if (!(std::abs(value) < 1e4)) fail(path, "row " + std::to_string(i / fit::kDofs) + " holds a value that is no angle (radians) or position (metres)");
    frames[i / fit::kDofs][static_cast<Eigen::Index>(i % fit::kDofs)] = value;
  }
  return frames;
}

/// Which angles an AMC line of a bone holds: the ASF's dof list, the same for every CMU subject.
std::string_view dofs_of(CmuBone bone) {
  using enum CmuBone;
  switch (bone) {
    case ltibia:
    case rtibia:
    case lradius:
    case rradius:
      return "x";
    case lfoot:
    case rfoot:
      return "xz";
    case lclavicle:
    case rclavicle:
      return "yz";
    default:
      return "xyz";
  }
}

std::vector<fit::PoseVector> read_amc(const std::filesystem::path& path) {
  constexpr std::size_t kStep = 4;  // 120 Hz to 30
  std::string text = read_file_bytes(path, kMostBytes);
  // Published files may end anywhere: a line that was cut must not be read as a shorter number.
  text.resize(text.rfind('\n') + 1);
  TextScanner in(text);
  std::vector<fit::PoseVector> frames;
  std::size_t number = 0;
  CmuPose pose;
  bool open = false, root_seen = false;
  std::size_t bones_seen = 0, bones_of_first = 0;
  const auto finish = [&](bool last) {
    if (!open) return;
    if (!root_seen) fail(path, in.where() + ": frame " + std::to_string(number) + " has no root");
    if (number == 1) bones_of_first = bones_seen;
    if (last && bones_seen < bones_of_first) return;  // the file ends inside its last frame
    if ((number - 1) % kStep == 0) frames.push_back(fold(pose, frames.empty() ? nullptr : &frames.back()));
  };
  bool degrees = true, degrees_said = false;
  while (in.next_line()) {
    const std::string_view name = in.word();
    if (name.empty() || name[0] == '#') continue;
    if (name[0] == ':') {
      if (name == ":DEGREES") degrees_said = true;
      if (name == ":RADIANS") degrees = false, degrees_said = true;
      continue;
    }
    if (std::size_t frame = 0; parse_number(name, frame)) {
      finish(false);
      if (++number > kMostFrames) fail(path, in.where() + ": too many frames");
      pose = CmuPose();
      open = true;
      root_seen = false;
      bones_seen = 0;
      continue;
    }
    if (!open) fail(path, in.where() + ": '" + std::string(name.substr(0, 40)) + "' stands before the first frame; this is no AMC file");
    const double unit = degrees ? kDegree : 1;
    if (name == "root") {
      std::array<double, 6> v;
      for (double& x : v) x = finite_number(path, in, in.word());
      pose.position = kMetresPerUnit * Vector3d(v[0], v[1], v[2]);
      pose.root = zyx(v[3] * unit, v[4] * unit, v[5] * unit);
      root_seen = true;
      continue;
    }
    ++bones_seen;
    const int bone = cmu_bone(name);
    if (bone < 0) continue;  // toes, hands, fingers
    std::array<double, 3> angle{};
    for (const char dof : dofs_of(static_cast<CmuBone>(bone))) angle[static_cast<std::size_t>(dof - 'x')] = finite_number(path, in, in.word()) * unit;
    if (!in.word().empty()) fail(path, in.where() + ": " + std::string(name) + " has more values than the CMU skeleton's degrees of freedom");
    const Matrix3d& c = cmu_axes(bone);
    pose.local[static_cast<std::size_t>(bone)] = c * zyx(angle[0], angle[1], angle[2]) * c.transpose();
  }
  finish(true);
  if (frames.empty()) fail(path, "holds no complete frame");
  if (!degrees_said) fail(path, "says neither :DEGREES nor :RADIANS; this is no AMC file");
  return frames;
}

/// What the conversion calls the ASF's bones.
int bone_of_bvh(std::string_view joint) {
  struct Name {
    std::string_view bvh, asf;
  };
  static constexpr std::array<Name, kCmuBones> names{{{"LeftUpLeg", "lfemur"},
                                                      {"LeftLeg", "ltibia"},
                                                      {"LeftFoot", "lfoot"},
                                                      {"RightUpLeg", "rfemur"},
                                                      {"RightLeg", "rtibia"},
                                                      {"RightFoot", "rfoot"},
                                                      {"LowerBack", "lowerback"},
                                                      {"Spine", "upperback"},
                                                      {"Spine1", "thorax"},
                                                      {"Neck", "lowerneck"},
                                                      {"Neck1", "upperneck"},
                                                      {"Head", "head"},
                                                      {"LeftShoulder", "lclavicle"},
                                                      {"LeftArm", "lhumerus"},
                                                      {"LeftForeArm", "lradius"},
                                                      {"RightShoulder", "rclavicle"},
                                                      {"RightArm", "rhumerus"},
                                                      {"RightForeArm", "rradius"}}};
  for (const Name& n : names)
    if (n.bvh == joint) return cmu_bone(n.asf);
  return -1;
}

struct Channel {
  int bone;   // -1: not needed, kCmuBones: the root
  char kind;  // 'x' 'y' 'z' rotation, 'X' 'Y' 'Z' position
};

std::vector<fit::PoseVector> read_bvh(const std::filesystem::path& path) {
  const std::string text = read_file_bytes(path, kMostBytes);
  TextScanner in(text);
  const auto next = [&]() -> std::string_view {
    while (true) {
      if (const auto w = in.word(); !w.empty()) return w;
      if (!in.next_line()) fail(path, "ends too early");
    }
  };
  if (next() != "HIERARCHY") fail(path, "does not begin with HIERARCHY; this is no BVH file");
  std::vector<Channel> channels;
  int bone = -1, found = 0;
  std::string_view word;
  while ((word = next()) != "MOTION") {
    if (word == "ROOT") {
      next();
      bone = kCmuBones;
    } else if (word == "JOINT") {
      bone = bone_of_bvh(next());
      if (bone >= 0) ++found;
    } else if (word == "OFFSET") {
      for (int i = 0; i < 3; ++i) finite_number(path, in, next());
    } else if (word == "CHANNELS") {
      int count = 0;
      if (!parse_number(next(), count) || count < 0 || count > 6) fail(path, in.where() + ": CHANNELS must be followed by 0 to 6");
      for (int i = 0; i < count; ++i) {
        const auto name = next();
        const bool rotation = name.ends_with("rotation"), position = name.ends_with("position");
        if ((!rotation && !position) || name.size() != 9 || name[0] < 'X' || name[0] > 'Z')
          fail(path, in.where() + ": the channel '" + std::string(name.substr(0, 40)) + "' is not known");
        channels.push_back({bone, static_cast<char>(rotation ? name[0] - 'X' + 'x' : name[0])});
      }
    } else if (word == "End") {
      next();
    } else if (word != "{" && word != "}") {
      fail(path, in.where() + ": '" + std::string(word.substr(0, 40)) + "' is not part of a BVH hierarchy");
    }
    if (channels.size() > 10'000) fail(path, in.where() + ": too many channels");
  }
  if (found < kCmuBones)
    fail(path, "has " + std::to_string(found) + " of the " + std::to_string(kCmuBones) +
                   " joints of the MotionBuilder-friendly CMU conversion (LeftUpLeg, LowerBack, Spine1 ...)");

  std::size_t count = 0;
  double frame_time = 0;
  if (next() != "Frames:" || !parse_number(next(), count) || count < 2 || count > kMostFrames)
    fail(path, in.where() + ": expected 'Frames:' and a number from 2 on (the first is a T-pose)");
  if (next() != "Frame" || next() != "Time:" || !((frame_time = finite_number(path, in, next())) > 1e-4 && frame_time < 1))
    fail(path, in.where() + ": expected 'Frame Time:' and seconds");
  const auto step = static_cast<std::size_t>(std::max(1.0, std::round(1.0 / 30 / frame_time)));

  std::vector<fit::PoseVector> frames;
  for (std::size_t f = 0; f < count; ++f) {
    CmuPose pose;
    for (const Channel& c : channels) {
      const double value = finite_number(path, in, next());
      if (c.bone < 0) continue;
      if (c.kind < 'a') {
        if (c.bone == kCmuBones) pose.position[c.kind - 'X'] = kMetresPerUnit * value;
        continue;
      }
      Matrix3d& r = c.bone == kCmuBones ? pose.root : pose.local[static_cast<std::size_t>(c.bone)];
      r = (r * Eigen::AngleAxisd(value * kDegree, Vector3d::Unit(c.kind - 'x'))).eval();
    }
    if (f >= 1 && (f - 1) % step == 0) frames.push_back(fold(pose, frames.empty() ? nullptr : &frames.back()));
  }
  return frames;
}

}  // namespace

bool is_motion_file(std::string_view name) { return name.ends_with(".npy") || name.ends_with(".amc") || name.ends_with(".bvh"); }

std::vector<fit::PoseVector> read_motion(const std::filesystem::path& path) {
  const std::string name = path.string();
  if (name.ends_with(".npy")) return read_npy_motion(path);
  if (name.ends_with(".amc")) return read_amc(path);
  if (name.ends_with(".bvh")) return read_bvh(path);
  fail(path, "is no motion file; known are .npy (N x 36), .amc and .bvh");
}

}  // namespace booth::daemon
