// Bins grow by half a per cent, so that a quantile is as exact for a millimetre as for a metre.
#include "tests/accuracy/report/tally.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace booth::accuracy {
namespace {

constexpr double kLeast = 1e-6;
const double kLogStep = std::log(1.005);

int bin_of(double value) { return value <= kLeast ? 0 : 1 + static_cast<int>(std::log(value / kLeast) / kLogStep); }
double middle_of(int bin) { return bin == 0 ? 0.0 : kLeast * std::exp((bin - 0.5) * kLogStep); }

}  // namespace

void Tally::add(double value, double weight) {
  if (!std::isfinite(value) || !std::isfinite(weight) || weight < 0) throw std::invalid_argument("a figure of the evaluation is not finite");
  if (weight == 0) return;
  least_ = empty() ? value : std::min(least_, value);
  most_ = empty() ? value : std::max(most_, value);
  weight_ += weight, sum_ += weight * value, squares_ += weight * value * value;
  histogram_[bin_of(value)] += weight;
}

void Tally::merge(const Tally& other) {
  n_ += other.n_;
  if (other.empty()) return;
  least_ = empty() ? other.least_ : std::min(least_, other.least_);
  most_ = empty() ? other.most_ : std::max(most_, other.most_);
  weight_ += other.weight_, sum_ += other.sum_, squares_ += other.squares_;
  for (const auto& [bin, weight] : other.histogram_) histogram_[bin] += weight;
}

double Tally::mean() const { return empty() ? 0 : sum_ / weight_; }

double Tally::sd() const {
  if (empty()) return 0;
  const double m = mean();
  return std::sqrt(std::max(0.0, squares_ / weight_ - m * m));
}

double Tally::quantile(double p) const {
  double below = 0;
  for (const auto& [bin, weight] : histogram_) {
    below += weight;
    if (below >= p * weight_ * (1 - 1e-12)) return std::clamp(middle_of(bin), least_, most_);
  }
  return most_;
}

nlohmann::json Tally::to_json() const {
  auto bins = nlohmann::json::array();
  for (const auto& [bin, weight] : histogram_) bins.push_back({bin, weight});
  return {{"n", n_}, {"weight", weight_}, {"sum", sum_}, {"squares", squares_}, {"least", least_}, {"most", most_}, {"bins", std::move(bins)}};
}

Tally Tally::from_json(const nlohmann::json& json) {
  Tally t;
  t.n_ = json.at("n");
  t.weight_ = json.at("weight"), t.sum_ = json.at("sum"), t.squares_ = json.at("squares"), t.least_ = json.at("least"), t.most_ = json.at("most");
  for (const auto& bin : json.at("bins")) t.histogram_[bin.at(0)] = bin.at(1);
  if (!std::isfinite(t.sum_ + t.squares_) || !(t.weight_ >= 0)) throw std::invalid_argument("a tally is damaged");
  return t;
}

}  // namespace booth::accuracy
