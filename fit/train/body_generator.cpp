// Target names carry their meaning: every token that is a slider word is a factor, and pairs of endings make a slider.
#include "fit/train/body_generator.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>

namespace booth::fit::train {
namespace {

constexpr std::array<std::string_view, 25> kFactors{"male",
                                                    "female",
                                                    "young",
                                                    "old",
                                                    "caucasian",
                                                    "asian",
                                                    "african",
                                                    "minmuscle",
                                                    "averagemuscle",
                                                    "maxmuscle",
                                                    "minweight",
                                                    "averageweight",
                                                    "maxweight",
                                                    "minheight",
                                                    "averageheight",
                                                    "maxheight",
                                                    "mincup",
                                                    "averagecup",
                                                    "maxcup",
                                                    "minfirmness",
                                                    "averagefirmness",
                                                    "maxfirmness",
                                                    "uncommonproportions",
                                                    "regularproportions",
                                                    "idealproportions"};

std::array<double, kFactors.size()> factor_values(const Sliders& s) {
  const auto low = [](double x) { return std::max(0.0, 1 - 2 * x); };
  const auto high = [](double x) { return std::max(0.0, 2 * x - 1); };
  const auto middle = [&](double x) { return 1 - low(x) - high(x); };
  const double old = 2 * s.age - 1;
  return {s.male,
          1 - s.male,
          1 - old,
          old,
          s.race[0],
          s.race[1],
          s.race[2],
          low(s.muscle),
          middle(s.muscle),
          high(s.muscle),
          low(s.weight),
          middle(s.weight),
          high(s.weight),
          low(s.height),
          middle(s.height),
          high(s.height),
          low(s.cup),
          middle(s.cup),
          high(s.cup),
          low(s.firmness),
          middle(s.firmness),
          high(s.firmness),
          low(s.proportions),
          middle(s.proportions),
          high(s.proportions)};
}

std::vector<int> factors_of(const std::string& name) {
  std::vector<int> list;
  std::size_t start = 0;
  while (start <= name.size()) {
    const std::size_t end = std::min(name.find_first_of("/-.", start), name.size());
    const auto found = std::find(kFactors.begin(), kFactors.end(), std::string_view(name).substr(start, end - start));
    if (found != kFactors.end()) list.push_back(static_cast<int>(found - kFactors.begin()));
    start = end + 1;
  }
  return list;
}

constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kPairs{
    {{"-decr", "-incr"}, {"-down", "-up"}, {"-in", "-out"}, {"-backward", "-forward"}}};

}  // namespace

BodyGenerator::BodyGenerator(const BaseBody& base, const std::vector<SparseRow>& rows) {
  // Base vertex -> the rows that it feeds.
  std::vector<std::vector<std::pair<int, float>>> feeds(static_cast<std::size_t>(base.vertices.cols()));
  base_ = Stacked::Zero(static_cast<Eigen::Index>(3 * rows.size()));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& [v, w] : rows[r]) {
      feeds[static_cast<std::size_t>(v)].emplace_back(static_cast<int>(r), w);
      sum += w * base.vertices.col(v);
    }
    base_.segment<3>(static_cast<Eigen::Index>(3 * r)) = sum.cast<float>();
  }
  displacement_ = Eigen::MatrixXf::Zero(base_.size(), static_cast<Eigen::Index>(base.targets.size()));
  std::map<std::string, Detail> details;
  int column = 0;
  for (const auto& [name, target] : base.targets) {
    for (std::size_t i = 0; i < target.vertex.size(); ++i)
      for (const auto& [row, w] : feeds[static_cast<std::size_t>(target.vertex[i])]) displacement_.col(column).segment<3>(3 * row) += w * target.offset[i];
    if (auto factors = factors_of(name); !factors.empty()) {
      macros_.push_back({column, std::move(factors)});
    } else {
      std::string stem = name;
      bool negative = false;
      for (const auto& [minus, plus] : kPairs)
        if (name.ends_with(minus) || name.ends_with(plus)) {
          negative = name.ends_with(minus);
          stem = name.substr(0, name.size() - (negative ? minus : plus).size());
        }
      auto& d = details[stem];
      d.name = stem;
      (negative ? d.negative : d.positive) = column;
    }
    ++column;
  }
  for (const auto& [stem, d] : details)
    if (d.positive >= 0) details_.push_back(d);
}

int BodyGenerator::detail(const std::string& name) const {
  for (std::size_t i = 0; i < details_.size(); ++i)
    if (details_[i].name == name) return static_cast<int>(i);
  throw std::out_of_range("the base body has no slider '" + name + "'");
}

void BodyGenerator::add_macro(const Sliders& s, Stacked& body) const {
  const auto value = factor_values(s);
  for (const auto& macro : macros_) {
    double weight = 1;
    for (int f : macro.factors) weight *= value[static_cast<std::size_t>(f)];
    if (weight != 0) body += static_cast<float>(weight) * displacement_.col(macro.column);
  }
}

void BodyGenerator::add_detail(int detail, float x, Stacked& body) const { change_detail(detail, 0, x, body); }

void BodyGenerator::change_detail(int detail, float from, float to, Stacked& body) const {
  const auto& d = details_[static_cast<std::size_t>(detail)];
  const auto positive = [&](float x) { return d.negative < 0 ? x : std::max(0.0f, x); };
  const auto negative = [](float x) { return std::max(0.0f, -x); };
  if (const float change = positive(to) - positive(from); change != 0) body += change * displacement_.col(d.positive);
  if (const float change = negative(to) - negative(from); d.negative >= 0 && change != 0) body += change * displacement_.col(d.negative);
}

Stacked BodyGenerator::make(const Sliders& s) const {
  Stacked body = base_;
  add_macro(s, body);
  for (int d = 0; d < static_cast<int>(s.detail.size()); ++d) add_detail(d, s.detail[d], body);
  return body;
}

}  // namespace booth::fit::train
