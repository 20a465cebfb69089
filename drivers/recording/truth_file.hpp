// truth.csv and truth.ply: what a recording knows of the person (docs/reference/recordings.md).
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "drivers/pacing/timeline.hpp"
#include "drivers/truth_body.hpp"
#include "hal/ground_truth.hpp"

namespace booth::drivers {

/// The 24 joints in the order of hal::TruthSample.
const std::array<std::string_view, hal::kTruthJoints>& truth_joint_names();

struct TruthRow {
  hal::UtcTime time{};
  hal::TruthSample sample;
};

/// Appends rows of truth.csv. Throws std::runtime_error (disk full, ...).
class TruthWriter {
 public:
  TruthWriter(const std::filesystem::path& path, std::vector<double> beta);
  void write(hal::UtcTime time, const hal::TruthSample& sample);
  void close();

 private:
  void check(bool ok) const;
  struct CloseFile {
    void operator()(std::FILE* f) const { std::fclose(f); }
  };
  std::filesystem::path path_;
  std::unique_ptr<std::FILE, CloseFile> file_;
  std::vector<double> beta_;
  hal::UtcTime last_{};
};

/// Rows in the order of time. Throws std::runtime_error naming file, line and what is wrong.
std::vector<TruthRow> read_truth_csv(const std::filesystem::path& path);

void write_truth_ply(const std::filesystem::path& path, const TruthBody& body);
TruthBody read_truth_ply(const std::filesystem::path& path);

/// The truth beside a recording: joints between two rows are interpolated, the surface is posed by `surface` where there is one.
class RecordedTruth final : public hal::GroundTruth {
 public:
  RecordedTruth(std::vector<TruthRow> rows, std::optional<TruthBody> body, TruthSurface surface, std::shared_ptr<const Timeline> timeline, hal::UtcTime zero);
  std::string body_name() const override { return body_ ? body_->name : "unknown"; }
  std::string sex() const override { return body_ ? body_->sex : "unknown"; }
  std::optional<hal::TruthSample> at(hal::MonotonicTime t) const override;
  std::vector<std::array<float, 3>> surface(hal::MonotonicTime t) const override;
  const std::vector<std::array<int, 3>>& faces() const override;

 private:
  const std::vector<TruthRow> rows_;
  const std::optional<TruthBody> body_;
  const TruthSurface surface_;
  const std::shared_ptr<const Timeline> timeline_;
  const hal::UtcTime zero_;
};

}  // namespace booth::drivers
