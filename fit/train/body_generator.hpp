// Makes bodies on the template topology from sliders, by the product rule that the base mesh's artists laid down.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/train/base_body.hpp"

namespace booth::fit::train {

/// Macro sliders lie in [0, 1]; 0.5 is the middle. age 0.5 is 25 years, 1 is 90 years.
struct Sliders {
  double male = 1, age = 0.5;
  std::array<double, 3> race{1.0 / 3, 1.0 / 3, 1.0 / 3};  ///< caucasian, asian, african; sum 1
  double muscle = 0.5, weight = 0.5, height = 0.5, proportions = 0.5, cup = 0.5, firmness = 0.5;
  Eigen::VectorXf detail;  ///< one per BodyGenerator::details(), in [-1, 1] ([0, 1] for one-sided ones)
};

/// A body: template vertices and the 24 joints, stacked as x0 y0 z0 x1 ...
using Stacked = Eigen::VectorXf;

class BodyGenerator {
 public:
  struct Detail {
    std::string name;                  ///< path without the -decr/-incr ending
    int negative = -1, positive = -1;  ///< columns of the displacement matrix; negative = -1: one-sided
  };

  /// `rows`: template vertices, then the 24 joints, as linear combinations of base vertices.
  BodyGenerator(const BaseBody& base, const std::vector<SparseRow>& rows);

  const std::vector<Detail>& details() const { return details_; }
  /// Index of a detail; throws std::out_of_range naming it.
  int detail(const std::string& name) const;
  int stacked_size() const { return static_cast<int>(base_.size()); }

  /// Adds the macro targets' weighted displacements.
  void add_macro(const Sliders& s, Stacked& body) const;
  /// Adds one detail slider's displacement.
  void add_detail(int detail, float x, Stacked& body) const;
  /// Moves one detail slider of a finished body.
  void change_detail(int detail, float from, float to, Stacked& body) const;
  /// The whole body.
  Stacked make(const Sliders& s) const;
  const Stacked& base() const { return base_; }

 private:
  struct Macro {
    int column;
    std::vector<int> factors;
  };
  Stacked base_;
  Eigen::MatrixXf displacement_;
  std::vector<Macro> macros_;
  std::vector<Detail> details_;
};

}  // namespace booth::fit::train
