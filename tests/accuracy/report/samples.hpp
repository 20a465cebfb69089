// The figures of an evaluation by what they are of: case, method, metric.
#pragma once

#include <deque>
#include <string>
#include <string_view>

#include "tests/accuracy/report/tally.hpp"

namespace booth::accuracy {

/// One row in the making. `unit` is part of the keys of its JSON: mean_cm, sd_cm, p95_cm.
struct Sample {
  std::string case_name, method, metric, unit;
  Tally tally;
};

/// In the order of first mention. Not thread-safe.
class Samples {
 public:
  /// Finds or makes the row; the reference holds until the Samples go.
  Tally& at(std::string_view case_name, std::string_view method, std::string_view metric, std::string_view unit);
  void merge(const Samples& other);
  const std::deque<Sample>& rows() const { return rows_; }
  std::deque<Sample>& rows() { return rows_; }
  /// nullptr when there is none.
  const Sample* find(std::string_view case_name, std::string_view method, std::string_view metric) const;

 private:
  std::deque<Sample> rows_;
};

/// One value that stands for one body, pose or frame.
inline void record(Samples& samples, std::string_view case_name, std::string_view method, std::string_view metric, std::string_view unit, double value) {
  Tally& t = samples.at(case_name, method, metric, unit);
  t.add(value);
  t.count();
}

}  // namespace booth::accuracy
