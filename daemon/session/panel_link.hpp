// Between the panel on the wall and the controller: presses become requests, states become light and sound, the panel's problems are told.
#pragma once

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "daemon/session/controller.hpp"
#include "hal/panel.hpp"

namespace booth::daemon {

/// A thread of its own. Panel, controller and clock must outlive it; destroy it before the controller is shut down.
class PanelLink {
 public:
  PanelLink(hal::Panel& panel, Controller& controller);
  ~PanelLink();
  PanelLink(const PanelLink&) = delete;

  /// Moves with every turn of the thread, and with the controller while a press waits for its answer: a slow disk is no hung panel.
  std::uint64_t progress() const { return progress_.load() + (waiting_.load() ? controller_.progress() : 0); }

 private:
  void loop();
  void request(const hal::TriggerEvent& event);
  void show();
  void play_calibration(const CalibrationStatus& now);

  hal::Panel& panel_;
  Controller& controller_;
  SessionState state_ = SessionState::idle;
  int counted_ = 0;  ///< seconds of the countdown that were heard last
  CalibrationStatus calibration_;
  std::atomic<std::uint64_t> progress_{0};
  std::atomic<bool> stop_{false}, waiting_{false};
  std::thread thread_;
};

}  // namespace booth::daemon
