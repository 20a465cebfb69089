// The calibration of a booth whose daemon goes on running: captures on a thread of its own, judges, stores or refuses.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>

#include "daemon/calibrate/live_capture.hpp"
#include "daemon/session/calibrator.hpp"

namespace booth::daemon {

struct BoothCalibrationSettings {
  std::filesystem::path file;  ///< where the calibration belongs; empty: nobody said
  std::string cannot;          ///< why these cameras cannot be calibrated at all; empty: they can
  LiveCaptureSettings capture;
  std::string software;
  std::function<void()> open, close;  ///< around each capture: the feed begins and ends to deliver; may be empty
};

/// Feed and clock outlive it. The destructor cancels what runs and waits for it.
class BoothCalibration final : public Calibrator {
 public:
  BoothCalibration(BoothCalibrationSettings settings, FrameFeed& feed, hal::Clock& clock);
  ~BoothCalibration() override;
  BoothCalibration(const BoothCalibration&) = delete;

  std::string why_not() const override;
  void begin(const std::string& by) override;
  void cancel() override { cancelled_ = true; }
  CalibrationStatus status() const override;

 private:
  void run(const std::string& by);
  void hear(const CaptureNews& news);
  void end(CalibrationStatus::Outcome outcome, const std::string& sentence, bool restart = false);
  std::string utc() const;

  const BoothCalibrationSettings settings_;
  FrameFeed& feed_;
  hal::Clock& clock_;
  std::atomic<bool> cancelled_{false};
  mutable std::mutex mutex_;  ///< guards what follows
  CalibrationStatus status_;
  std::thread thread_;
};

/// What an installer reads of a calibration that was accepted: "corners 0.14 px, 2.5 mm between cameras ...; origin by the board on the floor".
std::string summary_of(const fit::calibrate::Calibration& calibration);

}  // namespace booth::daemon
