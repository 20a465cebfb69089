// A table has tens of rows, so looking one up is a walk.
#include "tests/accuracy/report/samples.hpp"

namespace booth::accuracy {

Tally& Samples::at(std::string_view case_name, std::string_view method, std::string_view metric, std::string_view unit) {
  for (Sample& s : rows_)
    if (s.case_name == case_name && s.method == method && s.metric == metric) return s.tally;
  rows_.push_back({std::string(case_name), std::string(method), std::string(metric), std::string(unit), {}});
  return rows_.back().tally;
}

void Samples::merge(const Samples& other) {
  for (const Sample& s : other.rows_) at(s.case_name, s.method, s.metric, s.unit).merge(s.tally);
}

const Sample* Samples::find(std::string_view case_name, std::string_view method, std::string_view metric) const {
  for (const Sample& s : rows_)
    if (s.case_name == case_name && s.method == method && s.metric == metric) return &s;
  return nullptr;
}

}  // namespace booth::accuracy
