// Twelve sliders against nine measures: the surplus is settled by a soft pull to ordinary sliders.
#include "fit/train/person.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>

namespace booth::fit::train {
namespace {

constexpr std::array<std::string_view, kFittedMeasures> kNames{"stature", "mass", "chest", "waist", "buttock", "thigh", "calf", "trochanterion", "arm"};
constexpr std::array<std::string_view, 9> kTape{"bust-circ",       "waist-circ",      "hips-circ",       "thigh-circ",     "calf-circ",
                                                "upperleg-height", "lowerleg-height", "upperarm-length", "lowerarm-length"};
constexpr int kMacros = 3;  // height, weight, muscle
constexpr int kUnknowns = kMacros + static_cast<int>(kTape.size());
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;

/// What counts as one unit of misfit: metres (kilograms for mass). Lengths of limbs lie between landmarks that differ a little in definition.
/// Beyond this a body is not that person: the sliders' range ended.
const FittedMeasures kWorst = (FittedMeasures() << 0.02, 5, 0.05, 0.08, 0.05, 0.05, 0.03, 0.06, 0.04).finished();
const FittedMeasures kTolerance = (FittedMeasures() << 0.002, 0.4, 0.003, 0.003, 0.004, 0.004, 0.003, 0.008, 0.008).finished();
const Unknowns kOrdinary = (Unknowns() << 0.5, 0.6, 0.5, 0, 0, 0, 0, 0, 0, 0, 0, 0).finished();
/// How far the tape sliders may go: a little beyond their artists' range, the waist (10 cm a unit) far beyond.
const Unknowns kReach = (Unknowns() << 1, 1, 1, 1.3, 2.2, 1.3, 1.3, 1.3, 1.3, 1.3, 1.3, 1.3).finished();
const Unknowns kSpread = (Unknowns() << 0.2, 0.3, 0.3, 0.5, 0.8, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5).finished();

double clamp01(double x) { return std::clamp(x, 0.0, 1.0); }

}  // namespace

bool FittedBody::matches() const { return (error.cwiseAbs().array() <= kWorst.array()).all(); }

FittedMeasures measures_of(const Person& p) {
  return (FittedMeasures() << p.stature, p.mass, p.chest, p.waist, p.buttock, p.thigh, p.calf, p.trochanterion, p.arm).finished();
}

FittedMeasures fitted_measures(const MeasureValues& m) {
  const auto of = [&](Measure which) { return m[static_cast<std::size_t>(which)]; };
  return (FittedMeasures() << of(Measure::stature), of(Measure::mass), of(Measure::chest_girth), of(Measure::waist_girth), of(Measure::buttock_girth),
          of(Measure::thigh_girth), of(Measure::calf_girth), of(Measure::leg_length), of(Measure::arm_length))
      .finished();
}

std::string_view fitted_measure_name(int i) { return kNames[static_cast<std::size_t>(i)]; }

Widener::Widener(const std::vector<Person>& survey, double stature_sd, double mass_sd) {
  const double n = static_cast<double>(survey.size());
  mean_.setZero();
  for (const auto& p : survey) mean_ += measures_of(p) / n;
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, kFittedMeasures, 2> cross = Eigen::Matrix<double, kFittedMeasures, 2>::Zero();
  for (const auto& p : survey) {
    const FittedMeasures d = measures_of(p) - mean_;
    cov += d.head<2>() * d.head<2>().transpose() / n;
    cross += d * d.head<2>().transpose() / n;
  }
  slope_ = cov.ldlt().solve(cross.transpose()).transpose();
  stature_gain_ = stature_sd / std::sqrt(cov(0, 0));
  mass_on_stature_ = cov(0, 1) / cov(0, 0);
  const double residual = std::sqrt(cov(1, 1) - mass_on_stature_ * cov(0, 1));
  mass_gain_ = std::sqrt(std::max(0.0, mass_sd * mass_sd - std::pow(mass_on_stature_ * stature_sd, 2))) / residual;
}

Person Widener::widen(const Person& p) const {
  const FittedMeasures before = measures_of(p);
  const Eigen::Vector2d d = before.head<2>() - mean_.head<2>();
  Eigen::Vector2d wanted;
  wanted[0] = stature_gain_ * d[0];
  wanted[1] = mass_on_stature_ * wanted[0] + mass_gain_ * (d[1] - mass_on_stature_ * d[0]);
  // Nobody thinner than a body mass index of 16.5.
  const double stature = mean_[0] + wanted[0];
  wanted[1] = std::max(wanted[1], 16.5 * stature * stature - mean_[1]);
  const FittedMeasures after = before + slope_ * (wanted - d);
  Person w = p;
  w.stature = after[0], w.mass = after[1], w.chest = after[2], w.waist = after[3], w.buttock = after[4];
  w.thigh = after[5], w.calf = after[6], w.trochanterion = after[7], w.arm = after[8];
  return w;
}

PersonFitter::PersonFitter(const BodyGenerator& generator, const Measurer& measurer) : generator_(generator), measurer_(measurer) {
  for (const auto name : kTape) tape_.push_back(generator.detail("measure/measure-" + std::string(name)));
}

Sliders PersonFitter::draw(const Person& person, Random& random) const {
  Sliders s;
  s.male = person.sex == Sex::men ? 1 : 0;
  // Half at the age of the row, half anywhere up to 80: the survey ends at 58.
  const double years = random.uniform() < 0.5 ? person.age : 18 + 62 * random.uniform();
  s.age = std::clamp(0.5 + (years - 25) / 130, 0.5, 0.95);
  double sum = 0;
  for (auto& r : s.race) sum += r = -std::log(random.uniform());
  for (auto& r : s.race) r /= sum;
  s.proportions = clamp01(0.5 + 0.17 * random.normal());
  s.cup = clamp01(0.5 + 0.2 * random.normal());
  s.firmness = clamp01(0.5 + 0.2 * random.normal());

  const auto& details = generator_.details();
  s.detail = Eigen::VectorXf::Zero(static_cast<Eigen::Index>(details.size()));
  const std::string body_shape = person.sex == Sex::men ? "bodyshapes/bodyshapes-elvs-man" : "bodyshapes/bodyshapes-elvs-fem";
  std::vector<int> body_shapes, head_shapes;
  for (int d = 0; d < static_cast<int>(details.size()); ++d) {
    const std::string& name = details[static_cast<std::size_t>(d)].name;
    const auto has = [&](std::string_view part) { return name.find(part) != std::string::npos; };
    if (std::find(tape_.begin(), tape_.end(), d) != tape_.end()) continue;
    if (name.starts_with("bodyshapes/")) {
      if (name.starts_with(body_shape)) body_shapes.push_back(d);
    } else if (details[static_cast<std::size_t>(d)].negative < 0) {
      if (name.starts_with("head/")) head_shapes.push_back(d);
    } else if (name.starts_with("armslegs/r-")) {
      continue;  // drawn with the left one
    } else if (name.starts_with("armslegs/l-")) {
      if (has("-trans")) continue;  // would tear hand and foot from the limb
      const double common = random.normal(0.25, 0.8), difference = random.normal(0.06, 0.2);
      s.detail[d] = static_cast<float>(common + difference / 2);
      s.detail[generator_.detail("armslegs/r-" + name.substr(11))] = static_cast<float>(common - difference / 2);
    } else {
      double sigma = 0.25;
      if (has("-trans") || has("height") || has("pregnant") || has("napetowaist") || has("waisttohip")) sigma = 0.15;
      if (name.starts_with("breast/") && person.sex == Sex::men) sigma = 0.08;
      s.detail[d] = static_cast<float>(random.normal(sigma, 3 * sigma));
    }
  }
  for (const auto& shapes : {body_shapes, head_shapes})
    if (!shapes.empty() && random.uniform() < 0.6) {
      const auto which = std::min(shapes.size() - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(shapes.size())));
      s.detail[shapes[which]] = static_cast<float>(0.5 * random.uniform());
    }
  return s;
}

FittedBody PersonFitter::fit(const Person& person, Random random) const {
  Sliders s = draw(person, random);
  Stacked fixed = generator_.base();
  for (int d = 0; d < static_cast<int>(s.detail.size()); ++d) generator_.add_detail(d, s.detail[d], fixed);

  const Eigen::Index vertices = generator_.stacked_size() / 3 - kJoints;
  Vertices mesh(3, vertices);
  const auto measure = [&](const Stacked& body) {
    mesh = Eigen::Map<const Vertices>(body.data(), 3, vertices);
    const Points3 joints = Eigen::Map<const Eigen::Matrix<float, 3, kJoints>>(body.data() + 3 * vertices).cast<double>();
    return fitted_measures(measurer_.measure(mesh, joints));
  };
  const auto make = [&](const Unknowns& u) {
    s.height = u[0], s.weight = u[1], s.muscle = u[2];
    Stacked body = fixed;
    generator_.add_macro(s, body);
    for (std::size_t i = 0; i < tape_.size(); ++i) generator_.add_detail(tape_[i], static_cast<float>(u[kMacros + static_cast<int>(i)]), body);
    return body;
  };
  const FittedMeasures wanted = measures_of(person);
  const auto cost = [&](const FittedMeasures& m, const Unknowns& u) {
    return ((m - wanted).array() / kTolerance.array()).square().sum() + ((u - kOrdinary).array() / kSpread.array()).square().sum();
  };
  const auto limited = [](Unknowns v) {
    v.head<kMacros>() = v.head<kMacros>().cwiseMax(0.02).cwiseMin(0.98);
    return Unknowns(v.cwiseMax(-kReach).cwiseMin(kReach));
  };

  Unknowns u = kOrdinary;
  Stacked body = make(u);
  FittedMeasures m = measure(body);
  double best = cost(m, u), damping = 1e-2;
  for (int step = 0; step < 25; ++step) {
    Eigen::Matrix<double, kFittedMeasures, kUnknowns> jacobian;
    for (int i = 0; i < kUnknowns; ++i) {
      const double h = i < kMacros ? (u[i] > 0.5 ? -0.02 : 0.02) : (u[i] > 0 ? -0.05 : 0.05);
      Unknowns shifted = u;
      shifted[i] += h;
      if (i < kMacros) {
        jacobian.col(i) = (measure(make(shifted)) - m) / h;
      } else {
        Stacked moved = body;
        generator_.change_detail(tape_[static_cast<std::size_t>(i - kMacros)], static_cast<float>(u[i]), static_cast<float>(shifted[i]), moved);
        jacobian.col(i) = (measure(moved) - m) / h;
      }
    }
    const Eigen::Matrix<double, kFittedMeasures, kUnknowns> weighted = kTolerance.cwiseInverse().asDiagonal() * jacobian;
    const Unknowns prior = kSpread.cwiseInverse().cwiseAbs2();
    const Eigen::Matrix<double, kUnknowns, kUnknowns> normal =
        weighted.transpose() * weighted + Eigen::Matrix<double, kUnknowns, kUnknowns>(prior.asDiagonal());
    const Unknowns gradient = weighted.transpose() * ((m - wanted).array() / kTolerance.array()).matrix() + prior.cwiseProduct(u - kOrdinary);
    bool better = false;
    double gained = 0;
    for (int attempt = 0; attempt < 8 && !better; ++attempt, damping *= 6) {
      Eigen::Matrix<double, kUnknowns, kUnknowns> damped = normal;
      damped.diagonal() *= 1 + damping;
      const Unknowns next = limited(u - damped.ldlt().solve(gradient));
      const Stacked candidate = make(next);
      const FittedMeasures measured = measure(candidate);
      if (const double c = cost(measured, next); c < best) {
        gained = best - c;
        best = c, u = next, body = candidate, m = measured;
        better = true;
        damping = std::max(damping / 60, 1e-6);
      }
    }
    if (!better || gained < 1e-3 * best) break;
  }

  const Eigen::Vector3f root = body.segment<3>(3 * vertices);
  body.reshaped(3, vertices + kJoints).colwise() -= root;
  return {std::move(body), m - wanted};
}

}  // namespace booth::fit::train
