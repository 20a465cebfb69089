// One thread for each calibration; whoever asks sees a copy of how far it is.
#include "daemon/calibrate/booth_calibration.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <exception>

#include "daemon/calibrate/calibration_store.hpp"

namespace booth::daemon {

using Outcome = CalibrationStatus::Outcome;

std::string summary_of(const fit::calibrate::Calibration& c) {
  return fmt::format(
      "on views that the fit had not seen: corners {:.2f} px, {:.1f} mm between cameras (95 %: {:.1f}), depth {:.1f} mm off the board; origin by {}",
      c.errors.reprojection_px, c.errors.corner_mm, c.errors.corner_p95_mm, c.errors.plane_mm,
      c.origin_from_board ? "the board on the floor" : "the places that were planned");
}

BoothCalibration::BoothCalibration(BoothCalibrationSettings settings, FrameFeed& feed, hal::Clock& clock)
    : settings_(std::move(settings)), feed_(feed), clock_(clock) {}

BoothCalibration::~BoothCalibration() {
  cancel();
  if (thread_.joinable()) thread_.join();
}

std::string BoothCalibration::why_not() const {
  if (!settings_.cannot.empty()) return settings_.cannot;
  if (settings_.file.empty()) return "nobody says where the calibration belongs: set cameras.kinect2.calibration in the configuration";
  const auto folder = settings_.file.has_parent_path() ? settings_.file.parent_path() : std::filesystem::path(".");
  if (::access(folder.c_str(), W_OK) != 0)
    return fmt::format("{} cannot be written by boothd: set cameras.kinect2.calibration to a file under its state directory", folder.string());
  const std::lock_guard lock(mutex_);
  return status_.running ? "the last calibration is still being ended; try again in a moment" : "";
}

void BoothCalibration::begin(const std::string& by) {
  if (thread_.joinable()) thread_.join();  // it has ended: why_not() was asked
  cancelled_ = false;
  {
    const std::lock_guard lock(mutex_);
    status_ = {.running = true, .begun = status_.begun + 1, .next = "looking for the board", .restart = status_.restart};
  }
  thread_ = std::thread([this, by] { run(by); });
}

void BoothCalibration::run(const std::string& by) {
  try {
    if (settings_.open) settings_.open();
    LiveCaptureHooks hooks;
    hooks.news = [this](const CaptureNews& news) { hear(news); };
    hooks.stop = [this] { return cancelled_.load(); };
    const ViewCollector views = capture_live(feed_, clock_, settings_.capture, hooks);
    if (settings_.close) settings_.close();
    if (cancelled_) return end(Outcome::cancelled, "the calibration was stopped; nothing was changed");
    const auto result = fit::calibrate::calibrate(views.input());
    if (cancelled_) return end(Outcome::cancelled, "the calibration was stopped; nothing was changed");
    if (!result.accepted()) return end(Outcome::refused, result.sentence + "; the calibration stays as it was");
    store_calibration(settings_.file, {.cameras = views.cameras(),
                                       .result = result,
                                       .utc = utc(),
                                       .by = by,
                                       .software = settings_.software,
                                       .square = views.input().board.square,
                                       .views = views.input().views});
    end(Outcome::stored, summary_of(result), true);
  } catch (const std::exception& e) {
    if (settings_.close) settings_.close();
    end(Outcome::failed, e.what());
  }
}

void BoothCalibration::hear(const CaptureNews& news) {
  const std::lock_guard lock(mutex_);
  status_.cue = news.cue;
  status_.views = news.taken;
  status_.seen = fmt::format("{}", fmt::join(news.seen, ", "));
  status_.next = news.next;
}

void BoothCalibration::end(Outcome outcome, const std::string& sentence, bool restart) {
  const std::lock_guard lock(mutex_);
  status_.running = false;
  status_.outcome = outcome;
  status_.sentence = sentence;
  status_.restart = status_.restart || restart;
  status_.next.clear();
}

std::string BoothCalibration::utc() const {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(clock_.utc_now().time_since_epoch());
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(seconds.count())));
}

CalibrationStatus BoothCalibration::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace booth::daemon
