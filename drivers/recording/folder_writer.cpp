// The folder layout as it is written: pictures as they come, calibration first, everything published at the end.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/layouts.hpp"
#include "drivers/recording/png16.hpp"
#include "drivers/recording/staging.hpp"
#include "drivers/recording/text.hpp"
#include "drivers/recording/truth_file.hpp"

namespace booth::drivers {
namespace {

class FolderWriter final : public hal::DepthSink {
 public:
  FolderWriter(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras, const std::optional<TruthBody>& body,
               const std::vector<hal::DepthFrame>& background)
      : staging_(path), cameras_(cameras), beta_(body ? body->beta : std::vector<double>{}) {
    std::vector<CalibrationFiles> files(cameras_.size());
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      std::filesystem::create_directory(folder(i));
      files[i].folder = folder_name(i);
      index_.emplace_back(folder(i) / "depth.txt");
      index_.back() << "# timestamp_seconds filename\n";
    }
    for (const auto& frame : background) {
      const auto& k = camera_of(frame, cameras_).intrinsics;
      const auto i = static_cast<std::size_t>(hal::to_int(frame.camera));
      auto& names = files[i].background;
      names.push_back("background_" + std::to_string(names.size()) + ".png");
      write_png16(folder(i) / names.back(), k.width, k.height, frame.depth.data());
    }
    write_calibration(staging_.folder() / "calibration.toml", cameras_, files);
    if (body) write_truth_ply(staging_.folder() / "truth.ply", *body);
    next_.resize(cameras_.size());
    last_.resize(cameras_.size());
  }

  void write(const hal::DepthFrame& frame, hal::UtcTime utc) override {
    const auto& k = camera_of(frame, cameras_).intrinsics;
    const auto i = static_cast<std::size_t>(hal::to_int(frame.camera));
    char name[32];
    std::snprintf(name, sizeof name, "depth_%06llu.png", static_cast<unsigned long long>(next_[i]++));
    write_png16(folder(i) / name, k.width, k.height, frame.depth.data());
    // A wall clock that was set back must not make a recording that cannot be read.
    last_[i] = std::max(utc, last_[i] + hal::Nanoseconds(1));
    index_[i] << format_seconds(last_[i]) << ' ' << name << '\n';
    check(index_[i]);
  }

  void write_truth(hal::UtcTime utc, const hal::TruthSample& truth) override {
    if (!truth_) truth_.emplace(staging_.folder() / "truth.csv", beta_);
    truth_->write(utc, truth);
  }

  void close() override {
    for (auto& file : index_) {
      file.close();
      check(file);
    }
    if (truth_) truth_->close();
    staging_.publish();
  }

 private:
  std::string folder_name(std::size_t i) const { return "camera-" + std::to_string(i); }
  std::filesystem::path folder(std::size_t i) const { return staging_.folder() / folder_name(i); }
  void check(const std::ofstream& file) const {
    if (!file) throw std::runtime_error("cannot write in " + staging_.folder().string() + ": " + std::strerror(errno) + "; check the disk's space");
  }

  Staging staging_;
  const std::vector<hal::CameraDescription> cameras_;
  const std::vector<double> beta_;
  std::vector<std::ofstream> index_;
  std::vector<std::uint64_t> next_;
  std::vector<hal::UtcTime> last_;
  std::optional<TruthWriter> truth_;
};

}  // namespace

std::unique_ptr<hal::DepthSink> write_folder(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                             const std::optional<TruthBody>& body, const std::vector<hal::DepthFrame>& background) {
  return std::make_unique<FolderWriter>(path, cameras, body, background);
}

}  // namespace booth::drivers
