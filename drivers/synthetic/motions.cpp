// Key poses joined by curves that start and stop like a limb does, gaits as harmonics of the distance walked.
#include "drivers/synthetic/motions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "drivers/synthetic/pose_words.hpp"
#include "fit/body/exact_math.hpp"

namespace booth::drivers {
namespace {

using fit::PoseVector;
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kTwoPi = 2 * std::numbers::pi;

/// A pose and how far its lowest foot is above the floor.
struct State {
  PoseVector q;
  double lift = 0;
};

double sine(double x) { return fit::exact_sincos(x).sin; }
double cosine(double x) { return fit::exact_sincos(x).cos; }
/// Minimum jerk from 0 to 1.
double ease(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * u * (10 + u * (-15 + 6 * u));
}

// Of a left arm.
constexpr ArmAngles kHanging{-37, -15, 87, 25}, kForward{40, 0, 88, 28}, kRaised{57, 52, -10, 16}, kWaveOut{33, 51, 13, 20}, kWaveIn{27, 42, 5, 98},
    kBehind{-77, -24, 112, 22}, kUpAndForward{92, 21, 60, 28}, kSwungForward{-11, -32, 88, 17}, kSwungBack{-55, -14, 89, 38}, kAside{0, -20, 45, 10};

PoseVector with_arms(const PoseVector& q, const ArmAngles& a) { return with_right_arm(with_left_arm(q, a), a); }
ArmAngles mix(const ArmAngles& a, const ArmAngles& b, double t) {
  return {a.rx + t * (b.rx - a.rx), a.ry + t * (b.ry - a.ry), a.rz + t * (b.rz - a.rz), a.elbow + t * (b.elbow - a.elbow)};
}

/// Upright, arms hanging, feet a little apart: where every motion starts and ends.
PoseVector stand() {
  return with_arms(with(PoseVector::Zero(), {{"lfemur_rz", -17},
                                             {"rfemur_rz", 17},
                                             {"lfemur_rx", -3},
                                             {"rfemur_rx", -3},
                                             {"ltibia_rx", 6},
                                             {"rtibia_rx", 6},
                                             {"lfoot_rx", -3},
                                             {"rfoot_rx", -3}}),
                   kHanging);
}

/// Bends both legs and keeps the feet flat: the angles of each leg and the pelvis add up to zero.
PoseVector crouched(const PoseVector& q, double pelvis, double hip, double knee) {
  return with(q, {{"root_rx", pelvis},
                  {"lfemur_rx", -hip},
                  {"rfemur_rx", -hip},
                  {"ltibia_rx", knee},
                  {"rtibia_rx", knee},
                  {"lfoot_rx", hip - knee - pelvis},
                  {"rfoot_rx", hip - knee - pelvis}});
}

enum class Ease { both, into, out };  // minimum jerk; speeding up to the end; slowing down from the start

struct Key {
  double time;
  PoseVector q;
  Ease ease = Ease::both;  // of the way to this key
};

PoseVector between(const std::vector<Key>& keys, double t) {
  if (t <= keys.front().time) return keys.front().q;
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (t < keys[i].time) {
      const double u = (t - keys[i - 1].time) / (keys[i].time - keys[i - 1].time);
      const double s = keys[i].ease == Ease::both ? ease(u) : keys[i].ease == Ease::into ? u * u : u * (2 - u);
      return keys[i - 1].q + s * (keys[i].q - keys[i - 1].q);
    }
  return keys.back().q;
}

/// `seconds` long, stands at both ends.
struct Act {
  std::string_view name;
  double seconds;
  State (*at)(double t);
};

State a_pose(double t) {
  const PoseVector open = with_arms(with(stand(), {{"lfemur_rz", -9}, {"rfemur_rz", 9}}), kAside);
  return {between({{0, stand()}, {1.0, open}, {2.5, open}, {3.5, stand()}}, t)};
}

State wave(double t) {
  const PoseVector up = with(with_right_arm(stand(), mix(kWaveOut, kWaveIn, 0.5)), {{"head_ry", -8}, {"upperback_rz", 3}});
  PoseVector q = between({{0, stand()}, {1.0, up}, {3.4, up}, {4.4, stand()}}, t);
  if (t > 1.0 && t < 3.4) {
    const double swell = ease((t - 1.0) / 0.4) * ease((3.4 - t) / 0.4);
    const ArmAngles arm = mix(kWaveOut, kWaveIn, 0.5 + 0.5 * swell * sine(kTwoPi * (t - 1.0) / 0.8));
    q = with_right_arm(q, arm);
  }
  return {q};
}

State left_arm(double t) {
  const PoseVector up = with_left_arm(stand(), kRaised);
  return {between({{0, stand()}, {1.2, up}, {3.8, up}, {5.0, stand()}}, t)};
}

State squat(double t) {
  const PoseVector low =
      with(with_arms(crouched(stand(), 22, 100, 108), kForward), {{"upperback_rx", 12}, {"neck_rx", -15}, {"lfemur_ry", 10}, {"rfemur_ry", -10}});
  return {between({{0, stand()}, {1.2, low}, {1.7, low}, {2.9, stand()}}, t)};
}

State kick(double t) {
  const PoseVector back =
      with(with_left_arm(with_right_arm(stand(), kSwungForward), kSwungBack),
           {{"root_rx", 4}, {"rfemur_rx", 12}, {"rtibia_rx", 65}, {"rfoot_rx", 15}, {"lfemur_rx", -8}, {"ltibia_rx", 12}, {"lfoot_rx", -8}, {"root_rz", 3}});
  const PoseVector front = with(with_left_arm(with_right_arm(stand(), kSwungBack), mix(kHanging, kForward, 0.6)), {{"root_rx", -8},
                                                                                                                   {"rfemur_rx", -72},
                                                                                                                   {"rtibia_rx", 8},
                                                                                                                   {"rfoot_rx", 12},
                                                                                                                   {"lfemur_rx", 0},
                                                                                                                   {"ltibia_rx", 12},
                                                                                                                   {"lfoot_rx", -4},
                                                                                                                   {"upperback_rx", 10},
                                                                                                                   {"root_rz", 3}});
  return {between({{0, stand()}, {0.6, back}, {1.05, front}, {1.25, front}, {2.2, stand()}}, t)};
}

State roll_hands(double t) {
  constexpr double kIn = 0.9, kOut = 4.1, kEnd = 5.0;
  const auto rolling = [](double phase) -> ArmAngles { return {-7, -43.3 + 8.2 * cosine(phase - 0.66), 72, 102.7 + 10.5 * cosine(phase + 0.58)}; };
  const double phase = kTwoPi * (t - kIn) / 0.8;
  const PoseVector ready = with_right_arm(with_left_arm(stand(), rolling(0)), rolling(std::numbers::pi));
  if (t < kIn || t > kOut) return {between({{0, stand()}, {kIn, ready}, {kOut, ready}, {kEnd, stand()}}, t)};
  // The hands set off and come to rest smoothly; four whole turns.
  const double swept = 4 * kTwoPi * ease(phase / (4 * kTwoPi));
  return {with_right_arm(with_left_arm(stand(), rolling(swept)), rolling(swept + std::numbers::pi))};
}

State jump(double t) {
  constexpr double kTakeOff = 1.1, kGravity = 9.81, kSpeed = 1.6, kFlight = 2 * kSpeed / kGravity;
  constexpr double kLanding = kTakeOff + kFlight;
  const PoseVector low = with(with_arms(crouched(stand(), 25, 75, 80), kBehind), {{"upperback_rx", 15}, {"neck_rx", -10}});
  const PoseVector push =
      with(with_arms(stand(), mix(kHanging, kUpAndForward, 0.6)), {{"lfoot_rx", 25}, {"rfoot_rx", 25}, {"ltibia_rx", 12}, {"rtibia_rx", 12}});
  const PoseVector land = with(with_arms(stand(), mix(kHanging, kUpAndForward, 0.45)),
                               {{"lfoot_rx", 12}, {"rfoot_rx", 12}, {"lfemur_rx", -14}, {"rfemur_rx", -14}, {"ltibia_rx", 20}, {"rtibia_rx", 20}});
  const PoseVector soft = with(with_arms(crouched(stand(), 15, 50, 60), mix(kHanging, kForward, 0.4)), {{"upperback_rx", 8}});
  State s{between({{0, stand()}, {0.6, low}, {kTakeOff, push, Ease::into}, {kLanding, land}, {kLanding + 0.35, soft, Ease::out}, {2.6, stand()}}, t)};
  if (t > kTakeOff && t < kLanding) s.lift = (t - kTakeOff) * (kSpeed - 0.5 * kGravity * (t - kTakeOff));
  return s;
}

/// Legs and arms of a walk at a phase of the gait (one turn: two steps); `strength` 0 is standing.
PoseVector gait(double phase, double strength) {
  PoseVector q = stand();
  for (const bool left : {true, false}) {
    const double p = left ? phase : phase + std::numbers::pi;
    const double swing = 0.5 + 0.5 * cosine(p + 0.35);  // 1 in the middle of the swing
    const double hip = -3 - strength * (4 + 21 * sine(p)), knee = 6 + strength * (4 + 48 * swing * swing * swing);
    const double ankle = -3 + strength * (2 + 14 * sine(p + std::numbers::pi) * (1 - swing) - 4 * swing);
    const ArmAngles arm = mix(kHanging, sine(p) > 0 ? kSwungBack : kSwungForward, strength * std::abs(sine(p)));
    q = left ? with_left_arm(with(q, {{"lfemur_rx", hip}, {"ltibia_rx", knee}, {"lfoot_rx", ankle}}), arm)
             : with_right_arm(with(q, {{"rfemur_rx", hip}, {"rtibia_rx", knee}, {"rfoot_rx", ankle}}), arm);
  }
  return with(q, {{"upperback_ry", strength * 6 * sine(phase)}, {"root_rx", strength * 3}});
}

/// One closed loop. The heading A (1 - cos u) over the path brings the walker back to where it set off when A is the first zero of the Bessel
/// function J0: both integrals of the direction over a turn of u are then zero, and heading and curvature start and end at zero.
State walk(double t) {
  constexpr double kSeconds = 7.0, kRamp = 0.9, kPath = 5.4, kStrides = 5, kHeading = 2.404825557695773;
  constexpr double kSpeed = kPath / (kSeconds - kRamp);
  // Distance under a speed that rises and falls as 3u^2 - 2u^3, whose integral is u^3 - u^4/2.
  const auto ramp = [](double u) { return u * u * u * (1 - 0.5 * u); };
  const double s = t < kRamp              ? kSpeed * kRamp * ramp(t / kRamp)
                   : t < kSeconds - kRamp ? kSpeed * (t - 0.5 * kRamp)
                                          : kPath - kSpeed * kRamp * ramp((kSeconds - t) / kRamp);
  const double strength = ease(t / kRamp) * ease((kSeconds - t) / kRamp);
  PoseVector q = gait(kTwoPi * kStrides * s / kPath, strength);
  const auto heading = [](double u) { return kHeading * (1 - cosine(u)); };
  constexpr int kSteps = 400;
  const double u = kTwoPi * s / kPath;
  for (int i = 0; i < kSteps; ++i) {
    const double angle = heading(u * (i + 0.5) / kSteps);
    q[0] += s / kSteps * sine(angle);
    q[2] += s / kSteps * cosine(angle);
  }
  q[4] = heading(u);
  return {q};
}

/// To the left by half a turn in small steps, and back.
State turn(double t) {
  constexpr double kHalf = 2.4, kPause = 0.4;
  const bool back = t > kHalf + kPause;
  const double u = std::clamp(back ? (t - kHalf - kPause) / kHalf : t / kHalf, 0.0, 1.0);
  const double phase = 3 * kTwoPi * u, strength = 0.8 * ease(u / 0.2) * ease((1 - u) / 0.2);
  PoseVector q = stand();
  for (const bool left : {true, false}) {
    const double up = std::max(0.0, left ? sine(phase) : -sine(phase));
    const double lift = strength * up * up;
    q = left ? with(q, {{"lfemur_rx", -3 - 28 * lift}, {"ltibia_rx", 6 + 46 * lift}}) : with(q, {{"rfemur_rx", -3 - 28 * lift}, {"rtibia_rx", 6 + 46 * lift}});
  }
  const double share = ease(u);
  q[4] = std::numbers::pi * (back ? 1 - share : share);
  q[fit::dof_index("head_ry")] = (back ? -1 : 1) * 14 * kDegree * ease(u / 0.3) * ease((1 - u) / 0.4);
  return {q};
}

constexpr std::array<Act, 9> kActs{{{"a-pose", 3.5, a_pose},
                                    {"walk", 7.0, walk},
                                    {"turn", 5.6, turn},
                                    {"wave", 4.4, wave},
                                    {"kick", 2.2, kick},
                                    {"squat", 2.9, squat},
                                    {"roll-hands", 5.0, roll_hands},
                                    {"jump", 2.6, jump},
                                    {"left-arm", 5.0, left_arm}}};
constexpr std::array<std::string_view, 8> kShowcase{"a-pose", "wave", "walk", "kick", "squat", "turn", "roll-hands", "jump"};

const Act& act(std::string_view name) {
  return *std::find_if(kActs.begin(), kActs.end(), [&](const Act& a) { return a.name == name; });
}

}  // namespace

std::vector<std::string_view> motion_names() {
  std::vector<std::string_view> names;
  names.reserve(kActs.size() + 1);
  for (const Act& a : kActs) names.push_back(a.name);
  names.push_back("showcase");
  return names;
}

Motion motion_by_name(std::string_view name, double seconds, const Contact& contact) {
  std::vector<const Act*> acts;
  if (name == "showcase") {
    for (const auto part : kShowcase) acts.push_back(&act(part));
  } else if (std::any_of(kActs.begin(), kActs.end(), [&](const Act& a) { return a.name == name; })) {
    acts.push_back(&act(name));
  } else {
    std::string known;
    for (const auto n : motion_names()) known += (known.empty() ? "" : ", ") + std::string(n);
    throw std::invalid_argument("motion '" + std::string(name) + "' is not known; known are " + known);
  }
  double length = 0;
  for (const Act* a : acts) length += a->seconds;

  Motion motion;
  motion.cyclic = seconds <= 0;
  const long count = std::max(1L, std::lround((motion.cyclic ? length : seconds) * motion.rate) + (motion.cyclic ? 0 : 1));
  for (long k = 0; k < count; ++k) {
    double t = std::fmod(static_cast<double>(k) / motion.rate, length);
    std::size_t i = 0;
    while (i + 1 < acts.size() && t >= acts[i]->seconds) t -= acts[i++]->seconds;
    State s = acts[i]->at(t);
    s.q[1] = s.lift - lowest_foot(s.q, contact);
    motion.frames.push_back(s.q);
  }
  return motion;
}

}  // namespace booth::drivers
