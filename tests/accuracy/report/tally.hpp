// Mean, spread and quantiles of an error whose parts are computed apart, on different days if need be, and put together afterwards.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>

namespace booth::accuracy {

/// Weighted values, kept as sums and a histogram of half-per-cent bins. Merging in any order gives the same figures but for rounding. Not thread-safe.
class Tally {
 public:
  /// Weight 0 is ignored. Values that are not finite are errors of the caller: std::invalid_argument.
  void add(double value, double weight = 1);
  /// How many bodies, poses or frames the values so far stand for: what a table calls n.
  void count(std::uint64_t more = 1) { n_ += more; }
  void merge(const Tally& other);

  double mean() const;
  double sd() const;
  /// Within half a per cent; values <= 0 count as the least one.
  double quantile(double p) const;
  double most() const { return most_; }
  std::uint64_t n() const { return n_; }
  bool empty() const { return !(weight_ > 0); }

  nlohmann::json to_json() const;
  /// Throws nlohmann::json::exception or std::invalid_argument on anything that to_json() does not write.
  static Tally from_json(const nlohmann::json& json);

 private:
  double weight_ = 0, sum_ = 0, squares_ = 0, least_ = 0, most_ = 0;
  std::uint64_t n_ = 0;
  std::map<int, double> histogram_;  ///< weight in each bin
};

}  // namespace booth::accuracy
